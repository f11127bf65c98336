//! Path tracing: light arrives from the environment and from light sources, directly and after any number of
//! reflections.
//!
//! At each point of an opaque surface, a direction is sampled from the environment and one from the BSDF, weighted by
//! the balance heuristic (Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997), and each light
//! source is sampled. The path continues in the direction of the BSDF; from the third reflection on it ends at random
//! (Russian roulette). Surfaces of transmissive particles are specular, or reflect and refract at single microfacets
//! of a rough one: their rays split as in Whitted's model. Light is not sampled there: the environment and visible
//! lights are found by the scattered rays alone.
//!
//! Shadow rays to the environment end at transmissive surfaces, because the paths of the BSDF find its light behind
//! them. Shadow rays to light sources pass straight through: paths cannot find a light without extent. Where photons
//! bring the light of a source through transmissive surfaces (`path/caustics.rs`), its shadow rays end there.

use std::sync::Arc;

use super::{
    body_set::BodySet,
    bsdf::{Bsdf, bsdf_of, reflect_samples, surface_points},
    context::RenderContext,
    dimensions::{BOUNCED, BSDF, CONTINUATION, ENVIRONMENT, LIGHTS},
    integrator::Integrator,
    interface::{BoundaryTable, Interface, interface_of},
    layers::LightClass,
    lights::{Light, environment_along, sample_environment},
    nested::SurfaceLanes,
    roulette::SplitRule,
    sampler::{get_1d_lanes, get_2d_lanes},
    scene_shapes::Interior,
    scratch::PacketScratch,
    shading::{add, product, scale},
    specular::{Escape, SpecularHits},
    stream::{Continuation, RayStreams, SegmentPacket},
};
use crate::scene::Environment;
use glam::Vec3;
use spherule_surface::MaterialId;
use spherule_tree::math::{LANES, Lanes3, lane3, lanes_in, lanes_where, set_lane3, splat};

pub(super) mod ambient;
pub(super) mod catcher;
pub(super) mod caustics;
mod emission;
pub(super) mod ground;
mod light_channels;
mod scattering;

use ambient::AmbientLight;
use catcher::Catcher;
use ground::{Caustics, GroundLight};

/// Number of diffuse reflections from which on paths end at random.
const ROULETTE_START: u32 = 2;

/// Greatest probability with which a path continues then, so that paths between white surfaces end.
const MAX_CONTINUATION: f32 = 0.95;

/// See the module.
pub(super) struct PathIntegrator<'a> {
    context: RenderContext<'a>,
    environment: Option<&'a Environment>,
    /// The BSDFs of opaque surfaces, in the order of the materials of the scene.
    bsdfs: Vec<Box<dyn Bsdf>>,
    /// The surface of transmissive particles.
    interface: Box<dyn Interface>,
    /// The surfaces of several transmissive bodies.
    interfaces: Option<BoundaryTable<Box<dyn Interface>>>,
    split: SplitRule,
    /// Whether rays can hit a light.
    has_extents: bool,
    catcher: Option<Arc<Catcher>>,
    /// The light of second surfaces, if paths end there.
    ambient: Option<AmbientLight>,
    /// The light on the ground, if paths end there.
    ground_light: Option<Arc<GroundLight>>,
    /// The light of photons on other surfaces.
    caustics: Arc<Caustics>,
}

impl<'a> PathIntegrator<'a> {
    pub(super) fn new(context: RenderContext<'a>) -> Self {
        let catcher = Catcher::of(context.scene, context.settings).map(Arc::new);
        Self::with_catcher(context, catcher)
    }

    fn with_catcher(context: RenderContext<'a>, catcher: Option<Arc<Catcher>>) -> Self {
        let is_connected = context.shapes.connected_particles().is_some();
        // Black environments need no samples
        let given = context.scene.environment.as_deref();
        let environment = given.filter(|environment| !environment.is_black());
        Self {
            ambient: AmbientLight::of(context.settings, environment),
            environment,
            bsdfs: context.scene.materials.iter().map(|m| bsdf_of(m.finish)).collect(),
            interface: interface_of(context.scene.particle_material(), is_connected),
            interfaces: context.shapes.nested.as_ref().map(BoundaryTable::for_paths),
            split: SplitRule::new(context.settings, context.shapes.interior),
            catcher,
            ground_light: None,
            caustics: Arc::default(),
            has_extents: context.lights.iter().any(|light| light.has_extent()),
            context,
        }
    }

    /// Same as [`Self::new`], with the light of photons and the shadow catcher of `other`.
    pub(super) fn with_light_of(context: RenderContext<'a>, other: &Self) -> Self {
        Self {
            ground_light: other.ground_light.clone(),
            caustics: Arc::clone(&other.caustics),
            ..Self::with_catcher(context, other.catcher.clone())
        }
    }
}

impl Integrator for PathIntegrator<'_> {
    fn context(&self) -> &RenderContext<'_> {
        &self.context
    }

    fn is_stochastic(&self) -> bool {
        true
    }

    fn shade(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        // Add what rays see of lights, and infinitely far away
        let ended = self.add_emitted(segments, packet);
        packet.hits.mask &= !ended;
        packet.take_light(LightClass::Emission);
        let scattered = packet.media.scattered & !ended;
        packet.media.hidden &= scattered;
        // Mist covers what is behind it
        for lane in lanes_in(scattered & packet.media.in_mist) {
            packet.coverage[lane] = 1.0;
        }
        // Camera rays that hit nothing see walls of glass
        let unended = segments.lanes() & !(ended | scattered);
        self.context.pass_underlays(segments, depth, unended, self.environment, packet);
        // A catcher darkens what is behind it
        if let Some(catcher) = self.catcher.as_ref().filter(|_| depth == 1) {
            let lanes = packet.hits.lanes_of(MaterialId::GROUND);
            if lanes != 0 {
                self.catch_shadows(catcher, &self.surface(segments, depth, lanes), packet);
            }
        }
        // Add the background of rays that hit nothing, and end the rays at holdouts
        let held_out = self.context.holdout_lanes(depth, &packet.hits);
        let lanes = unended & !held_out;
        self.add_escaped(segments, depth, lanes, packet);
        // Mirrors see the same behind it
        if let Some(catcher) = self.catcher.as_ref().filter(|c| c.is_mirrored && depth > 1) {
            let lanes = packet.hits.lanes_of(MaterialId::GROUND);
            self.see_through(catcher, &self.surface(segments, depth, lanes), packet);
        }
        packet.clamp.keep_direct(segments, &packet.radiance, &packet.groups);
        packet.take_light(LightClass::Background);
        // Scatter light in media
        if scattered != 0 {
            self.scatter_in_media(segments, depth, scattered, packet, next);
        }
        if packet.hits.mask & !held_out == 0 {
            return;
        }
        // Reflect rays at panes; the others have passed them already
        let panes = self.context.pane_lanes(&packet.hits);
        if panes != 0 {
            self.shade_panes(segments, depth, panes, packet, next);
        }
        // End paths at a ground whose light is known
        let ground = packet.hits.lanes_of(MaterialId::GROUND);
        let mut ended = 0;
        if let Some(light) = self.ground_light.as_ref().filter(|_| ground != 0) {
            self.shade_ground(light, &self.surface(segments, depth, ground), packet);
            ended = ground;
        }
        // Reflect light at opaque surfaces
        let clear = self.context.shapes.transmissive_lanes(&packet.hits);
        let others = packet.hits.mask & !(clear | panes | held_out | ended);
        self.shade_reflecting(segments, depth, others, packet, next);
        // Reflect and refract rays at transmissive surfaces
        if clear != 0 {
            self.shade_transmissive(segments, depth, clear, packet, next);
        }
    }
}

impl PathIntegrator<'_> {
    /// Reflects light at the opaque surfaces of `lanes`, whose paths end at the last bounce, or already at the second
    /// intersection if ambient occlusion replaces the rest of them.
    fn shade_reflecting(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let max = self.context.settings.bounces;
        let mut opaque = lanes & lanes_where(|l| segments.bounces[l] <= max);
        if let Some(ambient) = &self.ambient {
            let second = opaque & lanes_where(|l| segments.bounces[l] > 0);
            if second != 0 {
                self.shade_ambient(ambient, &self.surface(segments, depth, second), packet);
            }
            opaque &= !second;
        }
        if opaque != 0 {
            self.shade_opaque(&self.surface(segments, depth, opaque), packet, next);
        }
    }
}

/// Path segments that end at opaque surfaces.
#[derive(Clone, Copy)]
struct Surface<'a> {
    segments: &'a SegmentPacket,
    depth: u32,
    lanes: u32,
    /// Index of each sample in its pixel.
    sample: [u32; LANES],
}

/// What is in the way of light samples.
#[derive(Debug, Clone, Copy)]
enum Occlusion {
    /// Nothing: the light casts no shadows.
    None,
    /// Opaque surfaces; light passes transmissive ones in a straight line.
    Straight,
    /// All surfaces.
    Opaque,
}

impl Occlusion {
    /// What is in the way of a light source, whose light no path finds behind transmissive surfaces.
    fn of(light: &dyn Light) -> Self {
        if light.casts_shadow() { Self::Straight } else { Self::None }
    }

    /// The same where photons bring the light that transmissive surfaces focus.
    fn beside_photons(light: &dyn Light) -> Self {
        match light.photon_source() {
            Some(_) => Self::Opaque,
            None => Self::of(light),
        }
    }
}

/// Dimension of the samples of a light source.
#[expect(clippy::cast_possible_truncation, reason = "there are few lights")]
const fn light_dimension(index: usize) -> u32 {
    LIGHTS + index as u32
}

impl PathIntegrator<'_> {
    fn surface<'s>(&self, segments: &'s SegmentPacket, depth: u32, lanes: u32) -> Surface<'s> {
        Surface {
            segments,
            depth,
            lanes,
            sample: segments.sample.map(|s| s % self.context.settings.samples),
        }
    }

    /// Whether rays of a BSDF sample light sources too, so that the balance heuristic weights both. Behind transmissive
    /// surfaces, only shadow rays find light sources.
    fn rays_hit_lights(&self) -> bool {
        self.context.shapes.interior == Interior::Opaque
    }

    fn shade_opaque(
        &self,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        self.prepare_surface(surface, packet);
        self.add_environment_light(surface, packet);
        self.add_lights(surface, packet);
        self.bounce(surface, packet, next);
    }

    /// Computes the points of an opaque surface with their colours, and the weight of light from there.
    fn prepare_surface(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        let (context, simd) = (&self.context, self.context.simd);
        // Transmissive particles have no colour
        context.base_colors(surface.segments, context.shapes.interior == Interior::Opaque, packet);
        let (rays, points) = (&surface.segments.rays, &mut packet.surface);
        surface_points(simd, rays, &packet.hits, &packet.base, points);
        if context.shapes.soft_spray.is_some() {
            // Light that foam scatters leaves from inside its drop, in all directions
            for lane in lanes_in(packet.hits.lanes_of(MaterialId::SPRAY)) {
                let inwards = -packet.hits.offset[lane] * lane3(&points.geometric, lane);
                set_lane3(&mut points.start, lane, lane3(&packet.hits.anchor, lane) + inwards);
            }
        }
        let opacity = &packet.hits.opacity;
        scale(simd, &packet.throughput, opacity, &mut packet.weight);
    }

    /// Evaluates the BSDFs for the directions of the light samples.
    fn eval(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        let (rays, direction) = (&surface.segments.rays, &packet.light.rays.direction);
        for (material, lanes) in packet.hits.materials_of(surface.lanes) {
            let (points, values) = (&packet.surface, &mut packet.bsdf);
            let bsdf = &self.bsdfs[material.index()];
            bsdf.eval(self.context.simd, rays, points, direction, lanes, values);
        }
    }

    /// Adds the light from a direction that is sampled from the environment.
    fn add_environment_light(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        // Paths inside a body only find the environment outside by refraction
        let lanes = surface.lanes & !surface.segments.inside;
        let Some(environment) = self.environment.filter(|_| lanes != 0) else {
            return;
        };
        self.reflect_environment(environment, surface, lanes, packet);
        let group = self.context.environment_group();
        self.add_direct(Occlusion::Opaque, group, surface, packet);
    }

    /// Adds the light of the light samples, which are of a light `group`, also to the channels for light and shadow.
    fn add_direct(
        &self,
        occlusion: Occlusion,
        group: usize,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        if packet.light.lanes == 0 {
            return;
        }
        self.scale_inside(surface, packet);
        self.divide_samples(surface, packet);
        let unoccluded = packet.unoccluded();
        let visible = self.add_visible(occlusion, group, surface, packet);
        let PacketScratch { split, light, radiance, .. } = packet;
        split.take_reflected(radiance);
        if let Some((lanes, unoccluded)) = unoccluded {
            split.add_direct(lanes, &unoccluded, visible, &light.radiance);
        }
    }

    /// Divides light that has entered bodies straight by the square of its index. Radiance rises by this factor where
    /// light enters the body and falls by it where light leaves, and paths leave out both. Light that enters straight
    /// has not risen: its irradiance behind a flat interface is that in front of it.
    fn scale_inside(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        for lane in lanes_in(surface.segments.inside & packet.light.lanes) {
            let ior = self.context.ior_at(surface.segments, lane);
            let leaving = lane3(&packet.light.radiance, lane) / (ior * ior);
            set_lane3(&mut packet.light.radiance, lane, leaving);
        }
    }

    /// Traces the shadow rays of the light samples, and adds the light that arrives. Returns the lanes that it reaches.
    fn add_visible(
        &self,
        occlusion: Occlusion,
        group: usize,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) -> u32 {
        let visible = self.trace_samples(occlusion, surface, packet);
        let PacketScratch { light: samples, radiance, groups, .. } = packet;
        let simd = self.context.simd;
        add(simd, &samples.radiance, &Vec3::ONE, visible, radiance);
        groups.add(simd, group, &samples.radiance, visible);
        visible
    }

    /// Traces the shadow rays of the light samples, and multiplies their radiance by the transmittance. Returns the
    /// lanes in which the light arrives.
    fn trace_samples(
        &self,
        occlusion: Occlusion,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) -> u32 {
        let (context, segments, depth) = (&self.context, surface.segments, surface.depth);
        let PacketScratch { light: samples, crossings, counts, .. } = packet;
        match occlusion {
            Occlusion::None => {
                context.attenuate_by_mist(segments, samples);
                samples.lanes
            }
            Occlusion::Straight => {
                context.trace_shadow_rays(segments, depth, samples, crossings, counts)
            }
            Occlusion::Opaque => context.unoccluded(segments, depth, samples, counts),
        }
    }

    /// Samples a direction from the environment, and the light from there that `lanes` reflect: `packet.light`.
    fn reflect_environment(
        &self,
        environment: &Environment,
        surface: &Surface<'_>,
        lanes: u32,
        packet: &mut PacketScratch,
    ) {
        // Sample a direction, and evaluate the BSDF for it
        let (simd, path) = (self.context.simd, &surface.segments.path);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, path, ENVIRONMENT, &surface.sample, &mut u);
        let start = &packet.surface.start;
        sample_environment(simd, environment.table(), start, &u, &mut packet.light);
        self.eval(surface, packet);
        let (values, weight) = (&packet.bsdf, &packet.weight);
        reflect_samples(simd, values, weight, true, lanes, &mut packet.light);
    }

    /// Adds the light of each light source, and of photons.
    fn add_lights(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        // Light that photons bring is not sampled through transmissive particles as well
        let with_photons = surface.lanes & self.photon_lanes(&packet.hits);
        for (index, light) in self.context.lights.iter().enumerate() {
            let competes = light.has_extent() && self.rays_hit_lights();
            // Sample the light twice where only some of the lanes have photons
            let group = self.context.light_group(index);
            let opaque = match light.photon_source() {
                Some(_) => with_photons,
                None => 0,
            };
            for (lanes, occlusion) in
                [(surface.lanes & !opaque, Occlusion::of(&**light)), (opaque, Occlusion::Opaque)]
            {
                if lanes != 0 {
                    let surface = &Surface { lanes, ..*surface };
                    self.reflect_light(index, competes, surface, packet);
                    self.add_direct(occlusion, group, surface, packet);
                }
            }
        }
        // Add the light that the photons bring
        if with_photons != 0 {
            self.add_caustics(with_photons, surface, packet);
        }
    }

    /// Samples a light source, and the light from there that the surface reflects: `packet.light`. `competes`: rays
    /// of the BSDF find the light, too.
    fn reflect_light(
        &self,
        index: usize,
        competes: bool,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        let (simd, light) = (self.context.simd, &self.context.lights[index]);
        let mut u = [splat(0.0); 2];
        if light.has_extent() {
            let path = &surface.segments.path;
            let (dimension, sample) = (light_dimension(index), &surface.sample);
            get_2d_lanes(simd, path, dimension, sample, &mut u);
        }
        light.sample_li(simd, &packet.surface.start, &u, &mut packet.light);
        self.eval(surface, packet);
        let (values, weight, lanes) = (&packet.bsdf, &packet.weight, surface.lanes);
        reflect_samples(simd, values, weight, competes, lanes, &mut packet.light);
    }

    /// Continues the paths in directions that are sampled from the BSDFs.
    fn bounce(&self, surface: &Surface<'_>, packet: &mut PacketScratch, next: &mut RayStreams) {
        let segments = surface.segments;
        let lanes = self.sample_bsdf(surface, packet);
        if packet.split.is_active {
            let direction = packet.leaving.reflected.direction;
            self.divide(surface, &direction, packet);
        }
        let rays = &mut packet.leaving.reflected;
        // The last segment of a path may be a shadow ray to the environment
        let max = self.context.settings.bounces;
        let is_last = |l: usize| segments.bounces[l] == max;
        let last = match self.context.shapes.interior {
            Interior::Opaque if !self.has_extents => lanes & lanes_where(is_last),
            // It may hit a light, or pass through transmissive surfaces
            _ => 0,
        };
        let throughput = &mut rays.throughput;
        let deeper = self.roulette(surface, lanes & !last, MAX_CONTINUATION, throughput);
        let how =
            Continuation { inside: segments.inside, crossed: BodySet::EMPTY, branch: BOUNCED };
        if self.catcher.as_ref().is_some_and(|catcher| catcher.is_mirrored) {
            let direction = rays.direction;
            let PacketScratch { hits, surface: points, leaving, .. } = &mut *packet;
            let diffuse = &mut leaving.reflected.diffuse;
            self.diffuse_part(surface, &direction, (hits, points), diffuse);
        }
        let rays = &mut packet.leaving.reflected;
        next.reflected.push(deeper, rays, segments, how);
        rays.diffuse = [splat(1.0); 3];
        // Infinite densities mark specular rays
        if last != 0 {
            self.add_last(surface, last, packet);
            packet.split.take_reflected(&packet.radiance);
        }
        packet.leaving.reflected.pdf = splat(f32::INFINITY);
    }

    /// Samples directions from the BSDFs: `packet.leaving.reflected`. Returns the lanes that have one.
    fn sample_bsdf(&self, surface: &Surface<'_>, packet: &mut PacketScratch) -> u32 {
        let (segments, simd) = (surface.segments, self.context.simd);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, &segments.path, BSDF, &surface.sample, &mut u);
        for (material, lanes) in packet.hits.materials_of(surface.lanes) {
            let (bsdf, points) = (&self.bsdfs[material.index()], &packet.surface);
            bsdf.sample(simd, &segments.rays, points, &u, lanes, &mut packet.bounce);
        }
        let PacketScratch { bounce, leaving, weight, surface: at, .. } = &mut *packet;
        let rays = &mut leaving.reflected;
        rays.origin = at.start;
        rays.direction = bounce.direction;
        rays.pdf = bounce.pdf;
        product(simd, weight, &bounce.weight, &mut rays.throughput);
        let throughput = &rays.throughput;
        let has_weight = |l| bounce.pdf[l] > 0.0 && lane3(throughput, l).max_element() > 0.0;
        surface.lanes & lanes_where(has_weight)
    }

    /// Adds the light of the environment along the last segments of paths, which are `lanes` of the reflected rays.
    fn add_last(&self, surface: &Surface<'_>, lanes: u32, packet: &mut PacketScratch) {
        if let Some(environment) = self.environment {
            self.aim_at_environment(environment, lanes, packet);
            if packet.light.lanes != 0 {
                let group = self.context.environment_group();
                self.add_visible(Occlusion::Opaque, group, surface, packet);
            }
        }
    }

    /// Prepares the light of the environment along `lanes` of the reflected rays: `packet.light`.
    fn aim_at_environment(
        &self,
        environment: &Environment,
        lanes: u32,
        packet: &mut PacketScratch,
    ) {
        let (rays, samples) = (&packet.leaving.reflected, &mut packet.light);
        samples.rays.origin = rays.origin;
        samples.rays.direction = rays.direction;
        samples.rays.t_min = splat(0.0);
        let along = [&rays.direction, &rays.throughput];
        let (simd, radiance) = (self.context.simd, &mut samples.radiance);
        environment_along(simd, environment, along, &rays.pdf, lanes, radiance);
        let is_bright = |l| lane3(&samples.radiance, l).max_element() > 0.0;
        samples.lanes = lanes & lanes_where(is_bright);
        let is_traced = |l: usize| samples.lanes >> l & 1 == 1;
        samples.rays.t_max =
            std::array::from_fn(|l| if is_traced(l) { f32::INFINITY } else { -1.0 });
    }

    /// Ends some of the long paths in `lanes` at random, and compensates the throughput of the others, which continue with
    /// a probability of at most `most`. Returns the lanes of paths that continue.
    fn roulette(
        &self,
        surface: &Surface<'_>,
        lanes: u32,
        most: f32,
        throughput: &mut Lanes3,
    ) -> u32 {
        let segments = surface.segments;
        let long = lanes & lanes_where(|l| segments.bounces[l] >= ROULETTE_START);
        if long == 0 {
            return lanes;
        }
        let mut u = splat(0.0);
        let simd = self.context.simd;
        get_1d_lanes(simd, &segments.path, CONTINUATION, &surface.sample, &mut u);
        let mut ended = 0;
        for lane in lanes_in(long) {
            let along = lane3(throughput, lane);
            let chance = along.max_element().min(most);
            if u[lane] < chance {
                set_lane3(throughput, lane, along / chance);
            } else {
                ended |= 1 << lane;
            }
        }
        lanes & !ended
    }

    /// Reflects the rays of `lanes` at panes.
    fn shade_panes(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let last = lanes & self.last_specular(segments, depth);
        (self.context).reflect_at_panes(segments, lanes, last, packet, next);
        if last != 0 {
            let PacketScratch { leaving, radiance, groups, .. } = &mut *packet;
            let rays = &leaving.reflected;
            let group = groups.of_mut(self.context.environment_group());
            for sum in [Some(radiance), group].into_iter().flatten() {
                self.add_seen(&rays.direction, &rays.throughput, last, sum);
            }
            packet.take_light(LightClass::Reflection);
        }
    }

    /// Reflects and refracts the rays of `lanes` at transmissive particles.
    fn shade_transmissive(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        for (id, lanes) in packet.hits.materials_of(lanes) {
            for found in self.context.divide_surface(segments, &packet.hits, id, lanes) {
                let interface = match (found.boundary, &self.interfaces) {
                    (Some(boundary), Some(interfaces)) => interfaces.of(boundary),
                    _ => &self.interface,
                };
                self.shade_interface(&**interface, segments, depth, found, packet, next);
            }
        }
    }

    /// Reflects and refracts the rays that are `found` at surfaces with one `interface`.
    fn shade_interface(
        &self,
        interface: &dyn Interface,
        segments: &SegmentPacket,
        depth: u32,
        found: SurfaceLanes,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let context = &self.context;
        let (rays, hits) = (&segments.rays, &packet.hits);
        let SurfaceLanes { lanes, inside, .. } = found;
        // Find the reflected and refracted rays
        let (simd, mut u) = (context.simd, [splat(0.0); 2]);
        if interface.is_random() {
            let sample = segments.sample.map(|s| s % context.settings.samples);
            get_2d_lanes(simd, &segments.path, BSDF, &sample, &mut u);
        }
        let (points, leaving) = (&mut packet.surface, &mut packet.leaving);
        interface.leave(simd, rays, hits, inside, &u, points, leaving);
        // Trace them; the last ones see the environment
        let hits = SpecularHits {
            segments,
            depth,
            lanes,
            crossed: found.crossed(),
            last: lanes & self.last_specular(segments, depth),
        };
        let escape = Escape {
            add: &|along, weight, lanes, sum| self.add_seen(along, weight, lanes, sum),
            group: context.environment_group(),
        };
        context.scatter(interface.dielectric(), &self.split, hits, packet, next, escape);
    }

    /// The lanes of rays that are not traced further at a specular surface: they see the environment.
    fn last_specular(&self, segments: &SegmentPacket, depth: u32) -> u32 {
        let max = self.context.settings.max_depth;
        lanes_where(|l| depth >= max + segments.bounces[l])
    }

    /// Adds what specular rays in a direction with a throughput see of the environment, only for `lanes`.
    fn add_seen(&self, along: &Lanes3, throughput: &Lanes3, lanes: u32, radiance: &mut Lanes3) {
        if let Some(environment) = self.environment {
            let simd = self.context.simd;
            let (specular, mut seen) = (splat(f32::INFINITY), [splat(0.0); 3]);
            environment_along(simd, environment, [along, throughput], &specular, lanes, &mut seen);
            add(simd, &seen, &Vec3::ONE, lanes, radiance);
        }
    }
}
