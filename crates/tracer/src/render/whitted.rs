//! Whitted ray tracing: eq. 4.1 of the thesis, `I = ambient + sum of lights + reflection*r*S + transmission*(1-r)*T`,
//! with reflection of lights by Blinn and Phong (4.2, program 3.1) and `r` by Schlick (4.3). If both weights are 1,
//! this is literally 4.1.
//!
//! Lights illuminate the surface of one connected body only from outside; from inside it only reflects and refracts.

use glam::Vec3;

use super::{
    bsdf::{BlinnPhong, eval_lanes, reflect_samples, surface_points},
    context::RenderContext,
    integrator::Integrator,
    interface::{BoundaryTable, Interface, smooth_interface_of},
    layers::LightClass,
    light_groups::NO_GROUP,
    light_split::ratio,
    lights::LightSamples,
    nested::SurfaceLanes,
    roulette::SplitRule,
    scene_shapes::Interior,
    scratch::PacketScratch,
    shading::{add, add_background, product, scale},
    specular::{Escape, SpecularHits},
    stream::{RayStreams, SegmentPacket},
};
use crate::scene::{Material, MaterialId, Owner};
use spherule_tree::math::splat;

/// Highlights of clear bodies below this fraction of the light count as dark.
const MIN_HIGHLIGHT: f32 = 1.0 / 4096.0;

/// A material as defined by equation 4.1 of the thesis.
struct WhittedMaterial {
    /// `Ka` times the ambient light, linear RGB.
    ambient: Vec3,
    bsdf: BlinnPhong,
    /// Whether lights illuminate it only from outside.
    is_body: bool,
    /// The surface that rays leave, if any do.
    interface: Option<Box<dyn Interface>>,
}

impl WhittedMaterial {
    /// A `material` under this ambient light. `is_body`: it is that of one connected body.
    fn new(material: &Material, ambient_light: Vec3, is_body: bool) -> Self {
        let is_body = is_body && material.transmission > 0.0;
        let sends_rays = material.reflection > 0.0 || material.transmission > 0.0;
        let mut found = Self {
            ambient: material.ambient * ambient_light,
            bsdf: BlinnPhong::new(material),
            is_body,
            interface: sends_rays.then(|| smooth_interface_of(material, is_body)),
        };
        if is_body && !found.has_color() {
            found.bsdf.min_highlight = MIN_HIGHLIGHT;
        }
        found
    }

    /// Whether its base colour is visible.
    fn has_color(&self) -> bool {
        self.ambient != Vec3::ZERO || self.bsdf.diffuse > 0.0
    }
}

/// Traces reflected and refracted rays, and samples every light at each intersection.
pub(super) struct WhittedIntegrator<'a> {
    pub(super) context: RenderContext<'a>,
    /// The materials of the scene, in its order.
    materials: Vec<WhittedMaterial>,
    /// The surfaces of several transmissive bodies.
    interfaces: Option<BoundaryTable<Box<dyn Interface>>>,
    /// Decides which of two rays are traced.
    pub(super) split: SplitRule,
}

impl<'a> WhittedIntegrator<'a> {
    pub(super) fn new(context: RenderContext<'a>) -> Self {
        let is_connected = context.shapes.connected_particles().is_some();
        let material = |material: &Material| {
            let is_body = match material.owner {
                Owner::Particles => is_connected,
                Owner::Style(_) => context.shapes.nested.is_some(),
                _ => false,
            };
            WhittedMaterial::new(material, context.scene.ambient_light, is_body)
        };
        Self {
            materials: context.scene.materials.iter().map(material).collect(),
            interfaces: context.shapes.nested.as_ref().map(BoundaryTable::smooth),
            split: SplitRule::new(context.settings, context.shapes.interior),
            context,
        }
    }

    /// Whether the base colours of the particles are visible.
    fn has_particle_color(&self) -> bool {
        self.materials[MaterialId::PARTICLES.index()].has_color()
    }
}

impl Integrator for WhittedIntegrator<'_> {
    fn context(&self) -> &RenderContext<'_> {
        &self.context
    }

    fn is_stochastic(&self) -> bool {
        self.context.shapes.interior != Interior::Opaque
            || !self.context.shapes.translucent.is_empty()
    }

    fn shade(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let context = &self.context;
        context.pass_underlays(segments, depth, segments.lanes(), None, packet);
        let held_out = context.holdout_lanes(depth, &packet.hits);
        // Add the background for rays that leave the scene
        if context.sees_background(depth) {
            let lanes = segments.lanes() & !held_out;
            context.add_background(segments, depth, lanes, packet);
            packet.take_light(LightClass::Background);
        }
        if packet.hits.mask & !held_out == 0 {
            return;
        }
        context.base_colors(segments, self.has_particle_color(), packet);
        // Shade the intersections of each material
        for (id, lanes) in packet.hits.materials_of(!held_out) {
            let material = &self.materials[id.index()];
            for surface in context.divide_surface(segments, &packet.hits, id, lanes) {
                self.shade_surface(segments, depth, material, surface, packet, next);
            }
        }
    }
}

impl WhittedIntegrator<'_> {
    /// Adds the light at intersections with surfaces of one `material`, and appends the rays that leave them.
    fn shade_surface(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        material: &WhittedMaterial,
        found: SurfaceLanes,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let context = &self.context;
        let SurfaceLanes { lanes, inside, boundary } = found;
        let interface = match (boundary, &self.interfaces) {
            (Some(boundary), Some(interfaces)) => Some(interfaces.of(boundary)),
            _ => material.interface.as_ref(),
        };
        let (simd, rays) = (context.simd, &segments.rays);
        let PacketScratch { hits, base, surface, leaving, .. } = &mut *packet;
        surface_points(simd, rays, hits, base, surface);
        if let Some(interface) = interface {
            interface.leave(simd, rays, hits, inside, &[splat(0.0); 2], surface, leaving);
        }
        let lit = if material.is_body { lanes & !inside } else { lanes };
        self.add_direct_light(segments, material, lit, depth, packet);
        if let Some(interface) = interface {
            // At the last depth, rays see the background
            let is_last = depth >= context.settings.max_depth;
            let last = if is_last { lanes } else { 0 };
            let hits = SpecularHits { segments, depth, lanes, crossed: found.crossed(), last };
            let (dielectric, background) = (interface.dielectric(), &context.background);
            let escape = Escape {
                add: &|along, weight, lanes, sum| {
                    add_background(simd, background, along, weight, lanes, sum);
                },
                group: NO_GROUP,
            };
            context.scatter(dielectric, &self.split, hits, packet, next, escape);
        }
    }

    /// Adds ambient light and the light of all light sources at the shading points of `lanes`.
    fn add_direct_light(
        &self,
        segments: &SegmentPacket,
        material: &WhittedMaterial,
        lanes: u32,
        depth: u32,
        packet: &mut PacketScratch,
    ) {
        if lanes == 0 {
            return;
        }
        self.add_ambient(material.ambient, lanes, packet);
        if material.bsdf.scatters() {
            self.add_lights(segments, &material.bsdf, lanes, depth, packet);
        }
    }

    /// Adds ambient light at the shading points of `lanes`, and leaves their throughput with opacity in `packet.weight`.
    fn add_ambient(&self, ambient: Vec3, lanes: u32, packet: &mut PacketScratch) {
        let simd = self.context.simd;
        let PacketScratch { hits, throughput, radiance, surface, weight, split, groups, .. } =
            packet;
        scale(simd, throughput, &hits.opacity, weight);
        let mut colored = [splat(0.0); 3];
        product(simd, &surface.albedo, weight, &mut colored);
        add(simd, &colored, &ambient, lanes, radiance);
        if let Some(group) = groups.of_mut(NO_GROUP) {
            add(simd, &colored, &ambient, lanes, group);
        }
        split.take(LightClass::Diffuse, radiance);
    }

    /// Adds the light of each visible light source at the shading points of `lanes`, after [`Self::add_ambient`].
    fn add_lights(
        &self,
        segments: &SegmentPacket,
        bsdf: &BlinnPhong,
        lanes: u32,
        depth: u32,
        packet: &mut PacketScratch,
    ) {
        let simd = self.context.simd;
        let PacketScratch {
            radiance,
            surface: points,
            bsdf: values,
            light: samples,
            crossings,
            weight,
            counts,
            split,
            groups,
            ..
        } = packet;
        for (index, light) in self.context.lights.iter().enumerate() {
            // Sample the light, and reflect it
            light.sample_li(simd, &points.start, &[splat(0.0); 2], samples);
            let rays = &segments.rays;
            let arriving = split.is_active.then(|| samples.clone());
            let mut reflect = |bsdf: &BlinnPhong, samples: &mut LightSamples| {
                let along = &samples.rays.direction;
                eval_lanes(simd, bsdf, rays, points, along, lanes, values);
                reflect_samples(simd, values, weight, false, lanes, samples);
            };
            reflect(bsdf, samples);
            if samples.lanes == 0 {
                continue;
            }
            if let Some(mut matte) = arriving {
                // Reflect the light without the highlight
                reflect(&bsdf.matte(), &mut matte);
                split.diffuse = ratio(&matte.radiance, &samples.radiance);
            }
            // Test which light arrives, and add it to the picture and its layers
            let unoccluded = split.has_shadow.then_some((samples.lanes, samples.radiance));
            let visible = if light.casts_shadow() {
                let context = &self.context;
                context.trace_shadow_rays(segments, depth, samples, crossings, counts)
            } else {
                samples.lanes
            };
            add(simd, &samples.radiance, &Vec3::ONE, visible, radiance);
            let group = self.context.light_group(index);
            groups.add(simd, group, &samples.radiance, visible);
            split.take_reflected(radiance);
            if let Some((lanes, unoccluded)) = unoccluded {
                split.add_direct(lanes, &unoccluded, visible, &samples.radiance);
            }
        }
    }
}
