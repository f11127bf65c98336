//! Whitted ray tracing: eq. 4.1 of the thesis, `I = ambient + sum of lights + reflection*r*S + transmission*(1-r)*T`,
//! with reflection of lights by Blinn and Phong (4.2, program 3.1) and `r` by Schlick (4.3). If both weights are 1,
//! this is literally 4.1.
//!
//! Lights illuminate the surface of one connected body only from outside; from inside it only reflects and refracts.

use glam::Vec3;

use super::{
    context::{Interior, RenderContext},
    integrator::Integrator,
    layers::LightClass,
    light_groups::NO_GROUP,
    light_split::ratio,
    materials::{Material, WhittedMaterial, material_of, reflect_lights},
    roulette::SplitRule,
    scratch::PacketScratch,
    shading::{add, add_background, product, scale},
    specular::{Escape, SpecularHits},
    stream::{RayStreams, SegmentPacket},
};
use crate::surface::MaterialId;
use spherule_tree::math::splat;

/// Traces reflected and refracted rays, and samples every light at each intersection.
pub(super) struct WhittedIntegrator<'a> {
    pub(super) context: RenderContext<'a>,
    /// The materials of the scene, in its order.
    materials: Vec<Box<dyn Material>>,
    /// Decides which of two rays are traced.
    pub(super) split: SplitRule,
}

impl<'a> WhittedIntegrator<'a> {
    pub(super) fn new(context: RenderContext<'a>) -> Self {
        let is_connected = context.connected_particles().is_some();
        let of_id = |id| material_of(context.scene, id, is_connected);
        Self {
            materials: context.scene.ids().map(of_id).collect(),
            split: SplitRule::new(context.settings, context.interior),
            context,
        }
    }

    fn particle_constants(&self) -> &WhittedMaterial {
        self.materials[MaterialId::PARTICLES.index()].constants()
    }
}

impl Integrator for WhittedIntegrator<'_> {
    fn context(&self) -> &RenderContext<'_> {
        &self.context
    }

    fn is_stochastic(&self) -> bool {
        self.context.interior != Interior::Opaque || self.context.translucent.is_some()
    }

    fn shade(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let context = &self.context;
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
        context.base_colors(segments, self.particle_constants().has_color(), packet);
        // Shade the intersections of each material
        for (id, lanes) in packet.hits.materials_of(!held_out) {
            let material = &self.materials[id.index()];
            let (rays, inside) = (&segments.rays, segments.inside);
            material.shading_points(context.simd, rays, &packet.hits, inside, &mut packet.points);
            let lit = material.lit_lanes(lanes, inside);
            self.add_direct_light(segments, &**material, lit, depth, packet);
            if material.constants().sends_rays() {
                // At the last depth, rays see the background
                let is_last = depth >= context.settings.max_depth;
                let hits =
                    SpecularHits { segments, depth, lanes, last: if is_last { lanes } else { 0 } };
                let (constants, split) = (material.constants(), &self.split);
                let (simd, background) = (context.simd, &context.background);
                let escape = Escape {
                    add: &|along, weight, lanes, sum| {
                        add_background(simd, background, along, weight, lanes, sum);
                    },
                    group: NO_GROUP,
                };
                context.scatter(constants, split, hits, packet, next, escape);
            }
        }
    }
}

impl WhittedIntegrator<'_> {
    /// Adds ambient light and the light of all light sources at the shading points of `lanes`.
    fn add_direct_light(
        &self,
        segments: &SegmentPacket,
        material: &dyn Material,
        lanes: u32,
        depth: u32,
        packet: &mut PacketScratch,
    ) {
        if lanes == 0 {
            return;
        }
        self.add_ambient(material.constants(), lanes, packet);
        if material.constants().scatters() {
            self.add_lights(segments, material, lanes, depth, packet);
        }
    }

    /// Adds ambient light at the shading points of `lanes`, and leaves their throughput with opacity in `packet.weight`.
    fn add_ambient(&self, constants: &WhittedMaterial, lanes: u32, packet: &mut PacketScratch) {
        let simd = self.context.simd;
        let PacketScratch { hits, throughput, radiance, base, weight, split, groups, .. } = packet;
        scale(simd, throughput, &hits.opacity, weight);
        let mut colored = [splat(0.0); 3];
        product(simd, base, weight, &mut colored);
        add(simd, &colored, &constants.ambient, lanes, radiance);
        if let Some(group) = groups.of_mut(NO_GROUP) {
            add(simd, &colored, &constants.ambient, lanes, group);
        }
        split.take(LightClass::Diffuse, radiance);
    }

    /// Adds the light of each visible light source at the shading points of `lanes`, after [`Self::add_ambient`].
    fn add_lights(
        &self,
        segments: &SegmentPacket,
        material: &dyn Material,
        lanes: u32,
        depth: u32,
        packet: &mut PacketScratch,
    ) {
        let (simd, constants) = (self.context.simd, material.constants());
        let PacketScratch {
            radiance,
            base,
            points,
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
            material.reflect(simd, rays, points, base, weight, lanes, samples);
            if samples.lanes == 0 {
                continue;
            }
            if let Some(mut matte) = arriving {
                // Reflect the light without the highlight
                let constants = &WhittedMaterial { specular: 0.0, ..*constants };
                reflect_lights(simd, constants, rays, points, base, weight, lanes, &mut matte);
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
