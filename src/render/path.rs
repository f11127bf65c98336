//! Path tracing: light arrives from the environment and from light sources, directly and after any number of
//! reflections.
//!
//! At each point of an opaque surface, a direction is sampled from the environment and one from the BSDF, weighted by
//! the balance heuristic (Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997), and each light
//! source is sampled. The path continues in the direction of the BSDF; from the third reflection on it ends at random
//! (Russian roulette). Surfaces of transmissive particles are specular: their rays split as in Whitted's model.
//!
//! Shadow rays to the environment end at transmissive surfaces, because the paths of the BSDF find its light behind
//! them. Shadow rays to light sources pass straight through: paths cannot find a light without extent.

use super::{
    bsdf::{Bsdf, bsdfs_of, reflect_samples, surface_points},
    context::{Interior, RenderContext},
    dimensions::{BOUNCED, BSDF, CONTINUATION, ENVIRONMENT, LIGHTS},
    integrator::Integrator,
    lights::{Emission, environment_along, sample_environment},
    materials::{Material, materials_of},
    roulette::SplitRule,
    sampler::{get_1d_lanes, get_2d_lanes},
    scratch::PacketScratch,
    shading::{add, product, scale},
    specular::SpecularHits,
    stream::{RayStreams, SegmentPacket},
};
use crate::math::{LANES, Lanes, Lanes3, lane3, lanes_in, set_lane3, splat};
use crate::scene::Environment;
use crate::surface::MaterialId;
use glam::Vec3;

/// Number of diffuse reflections from which on paths end at random.
const ROULETTE_START: u32 = 2;

/// Greatest probability with which a path continues then, so that paths between white surfaces end.
const MAX_CONTINUATION: f32 = 0.95;

/// See the module.
pub(super) struct PathIntegrator<'a> {
    context: RenderContext<'a>,
    environment: Option<&'a Environment>,
    /// Opaque surfaces by [`MaterialId`].
    bsdfs: [Box<dyn Bsdf>; MaterialId::COUNT],
    /// The specular surface of transmissive particles.
    interface: Box<dyn Material>,
    split: SplitRule,
    /// Whether rays can hit a light.
    has_extents: bool,
}

impl<'a> PathIntegrator<'a> {
    pub(super) fn new(context: RenderContext<'a>) -> Self {
        let is_connected = context.connected_particles().is_some();
        let [interface, ..] = materials_of(context.scene, is_connected);
        let environment = context.scene.environment.as_deref();
        Self {
            environment: environment.filter(|environment| !environment.is_black()),
            bsdfs: bsdfs_of(context.scene.material.finish),
            interface,
            split: SplitRule::new(context.settings, context.interior),
            has_extents: context.lights.iter().any(|light| light.has_extent()),
            context,
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
        self.add_escaped(segments, depth, segments.lanes() & !ended, packet);
        if packet.hits.mask == 0 {
            return;
        }
        // Reflect light at opaque surfaces
        let clear = match self.context.interior {
            Interior::Opaque => 0,
            Interior::Spheres | Interior::Body => packet.hits.lanes_of(MaterialId::PARTICLES),
        };
        let max = self.context.settings.bounces;
        let opaque = packet.hits.mask & !clear & lanes_where(|l| segments.bounces[l] <= max);
        if opaque != 0 {
            let surface = Surface {
                segments,
                depth,
                lanes: opaque,
                sample: segments.sample.map(|s| s % self.context.settings.samples),
            };
            self.shade_opaque(&surface, packet, next);
        }
        // Reflect and refract rays at transmissive surfaces
        if clear != 0 {
            self.shade_transmissive(segments, depth, clear, packet, next);
        }
    }
}

/// Path segments that end at opaque surfaces.
struct Surface<'a> {
    segments: &'a SegmentPacket,
    depth: u32,
    lanes: u32,
    /// Index of each sample in its pixel.
    sample: [u32; LANES],
}

/// Bit mask of the lanes for which `holds`.
fn lanes_where(holds: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |lanes, lane| lanes | u32::from(holds(lane)) << lane)
}

impl PathIntegrator<'_> {
    /// Whether rays of a BSDF sample light sources too, so that the balance heuristic weights both. Behind transmissive
    /// surfaces, only shadow rays find light sources.
    fn rays_hit_lights(&self) -> bool {
        self.context.interior == Interior::Opaque
    }

    /// Adds the radiance of lights that rays hit: of rays sampled from a BSDF, weighted against the sampling of the light,
    /// and of visible lights before everything else. Returns the lanes of rays that end at visible lights.
    fn add_emitted(&self, segments: &SegmentPacket, packet: &mut PacketScratch) -> u32 {
        if !self.has_extents {
            return 0;
        }
        let sampled = match self.rays_hit_lights() {
            true => segments.lanes() & lanes_where(|l| segments.pdf[l] < f32::INFINITY),
            false => 0,
        };
        let seen = segments.lanes() & lanes_where(|l| segments.bounces[l] == 0);
        let mut emission = Emission::default();
        let (mut nearest, mut color) = ([None; LANES], [Vec3::ZERO; LANES]);
        for light in self
            .context
            .lights
            .iter()
            .filter(|light| light.has_extent())
        {
            // Find the rays that hit the light before a surface
            let lanes = sampled | if light.is_visible() { seen } else { 0 };
            if lanes == 0 {
                continue;
            }
            light.intersect(self.context.simd, &segments.rays, &mut emission);
            for lane in lanes_in(lanes & emission.lanes) {
                let is_first = match packet.hits.mask >> lane & 1 {
                    0 => true,
                    _ => emission.t[lane] < segments.rays.t_max[lane],
                };
                if !is_first {
                    continue;
                }
                // Add its radiance, or keep the nearest visible light
                if sampled >> lane & 1 == 1 {
                    let pdf = segments.pdf[lane];
                    let weight = pdf / (pdf + emission.pdf[lane]);
                    let arriving = lane3(&packet.throughput, lane) * (weight * emission.radiance);
                    let sum = lane3(&packet.radiance, lane) + arriving;
                    set_lane3(&mut packet.radiance, lane, sum);
                } else if nearest[lane].is_none_or(|t| emission.t[lane] < t) {
                    nearest[lane] = Some(emission.t[lane]);
                    color[lane] = emission.radiance;
                }
            }
        }
        // Add the visible lights
        let ended = lanes_where(|l| nearest[l].is_some());
        for lane in lanes_in(ended) {
            let sum = lane3(&packet.radiance, lane) + lane3(&packet.throughput, lane) * color[lane];
            set_lane3(&mut packet.radiance, lane, sum);
        }
        ended
    }

    /// Adds the radiance for rays of `lanes` without an intersection, and behind surfaces that are not fully opaque:
    /// camera rays see the background, unless the environment is visible.
    fn add_escaped(
        &self,
        segments: &SegmentPacket,
        depth: u32,
        lanes: u32,
        packet: &mut PacketScratch,
    ) {
        let context = &self.context;
        if depth == 1 && !context.scene.is_environment_visible {
            if context.sees_background(depth) {
                context.add_background(segments, lanes, packet);
            }
            return;
        }
        if depth == 1 && !context.sees_background(depth) {
            return;
        }
        let Some(environment) = self.environment else {
            return;
        };
        let PacketScratch {
            hits,
            throughput,
            radiance,
            weight,
            ..
        } = packet;
        let lanes = lanes & (!hits.mask | hits.lanes_of(MaterialId::GROUND));
        if lanes == 0 {
            return;
        }
        let part = std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => 1.0,
            _ => 1.0 - hits.opacity[lane],
        });
        scale(context.simd, throughput, &part, weight);
        // Shadow rays do not pass a ground that fades out, so its paths have the full weight
        let pdf: Lanes = std::array::from_fn(|lane| match hits.mask >> lane & 1 {
            0 => segments.pdf[lane],
            _ => f32::INFINITY,
        });
        let direction = &segments.rays.direction;
        let mut seen = [splat(0.0); 3];
        environment_along(
            context.simd,
            environment,
            direction,
            &pdf,
            weight,
            &mut seen,
        );
        add(context.simd, &seen, &Vec3::ONE, lanes, radiance);
    }

    fn shade_opaque(
        &self,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        next: &mut RayStreams,
    ) {
        let context = &self.context;
        context.base_colors(true, packet);
        let rays = &surface.segments.rays;
        surface_points(
            context.simd,
            rays,
            &packet.hits,
            &packet.base,
            &mut packet.surface,
        );
        scale(
            context.simd,
            &packet.throughput,
            &packet.hits.opacity,
            &mut packet.weight,
        );
        self.add_environment_light(surface, packet);
        self.add_lights(surface, packet);
        self.bounce(surface, packet, next);
    }

    /// Evaluates the BSDFs for the directions of the light samples.
    fn eval(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        for (number, bsdf) in (0..).zip(&self.bsdfs) {
            let lanes = surface.lanes & packet.hits.lanes_of(MaterialId(number));
            if lanes != 0 {
                let (rays, direction) = (&surface.segments.rays, &packet.light.rays.direction);
                let (points, values) = (&packet.surface, &mut packet.bsdf);
                bsdf.eval(self.context.simd, rays, points, direction, lanes, values);
            }
        }
    }

    /// Adds the light from a direction that is sampled from the environment.
    fn add_environment_light(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        // Paths inside a body only find the environment outside by refraction
        let lanes = surface.lanes & !surface.segments.inside;
        let Some(environment) = self.environment.filter(|_| lanes != 0) else {
            return;
        };
        // Sample a direction, and evaluate the BSDF for it
        let simd = self.context.simd;
        let mut u = [splat(0.0); 2];
        get_2d_lanes(
            simd,
            &surface.segments.path,
            ENVIRONMENT,
            &surface.sample,
            &mut u,
        );
        let start = &packet.surface.start;
        sample_environment(simd, environment, start, &u, &mut packet.light);
        self.eval(surface, packet);
        let (values, weight) = (&packet.bsdf, &packet.weight);
        reflect_samples(simd, values, weight, true, lanes, &mut packet.light);
        // Trace the shadow rays
        self.add_unoccluded(surface, packet);
    }

    /// Traces the shadow rays of environment samples, and adds those that arrive.
    fn add_unoccluded(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        let context = &self.context;
        let (samples, counts) = (&mut packet.light, &mut packet.counts);
        if samples.lanes == 0 {
            return;
        }
        let lanes = context.unoccluded(surface.segments, surface.depth, samples, counts);
        let radiance = &mut packet.radiance;
        add(
            context.simd,
            &packet.light.radiance,
            &Vec3::ONE,
            lanes,
            radiance,
        );
    }

    /// Adds the light of each light source.
    fn add_lights(&self, surface: &Surface<'_>, packet: &mut PacketScratch) {
        let (context, simd) = (&self.context, self.context.simd);
        for (light, dimension) in context.lights.iter().zip(LIGHTS..) {
            // Sample the light, and evaluate the BSDF for its direction
            let mut u = [splat(0.0); 2];
            if light.has_extent() {
                get_2d_lanes(
                    simd,
                    &surface.segments.path,
                    dimension,
                    &surface.sample,
                    &mut u,
                );
            }
            light.sample_li(simd, &packet.surface.start, &u, &mut packet.light);
            self.eval(surface, packet);
            let competes = light.has_extent() && self.rays_hit_lights();
            let (values, weight, lanes) = (&packet.bsdf, &packet.weight, surface.lanes);
            reflect_samples(simd, values, weight, competes, lanes, &mut packet.light);
            if packet.light.lanes == 0 {
                continue;
            }
            // Trace the shadow rays
            let PacketScratch {
                light: samples,
                crossings,
                counts,
                radiance,
                ..
            } = &mut *packet;
            let visible = if light.casts_shadow() {
                let (segments, depth) = (surface.segments, surface.depth);
                context.trace_shadow_rays(segments, depth, samples, crossings, counts)
            } else {
                samples.lanes
            };
            add(
                context.simd,
                &samples.radiance,
                &Vec3::ONE,
                visible,
                radiance,
            );
        }
    }

    /// Continues the paths in directions that are sampled from the BSDFs.
    fn bounce(&self, surface: &Surface<'_>, packet: &mut PacketScratch, next: &mut RayStreams) {
        // Sample directions
        let (segments, simd) = (surface.segments, self.context.simd);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, &segments.path, BSDF, &surface.sample, &mut u);
        for (number, bsdf) in (0..).zip(&self.bsdfs) {
            let lanes = surface.lanes & packet.hits.lanes_of(MaterialId(number));
            if lanes != 0 {
                let (points, samples) = (&packet.surface, &mut packet.bounce);
                bsdf.sample(simd, &segments.rays, points, &u, lanes, samples);
            }
        }
        let PacketScratch {
            bounce,
            points,
            weight,
            surface: at,
            ..
        } = &mut *packet;
        let rays = &mut points.reflected;
        rays.origin = at.start;
        rays.direction = bounce.direction;
        rays.pdf = bounce.pdf;
        product(simd, weight, &bounce.weight, &mut rays.throughput);
        let throughput = &rays.throughput;
        let has_weight = |l| bounce.pdf[l] > 0.0 && lane3(throughput, l).max_element() > 0.0;
        let lanes = surface.lanes & lanes_where(has_weight);
        // The last segment of a path may be a shadow ray to the environment
        let max = self.context.settings.bounces;
        let is_last = |l: usize| segments.bounces[l] == max;
        let last = match self.context.interior {
            Interior::Opaque if !self.has_extents => lanes & lanes_where(is_last),
            // It may hit a light, or pass through transmissive surfaces
            _ => 0,
        };
        let deeper = self.roulette(surface, lanes & !last, &mut rays.throughput);
        next.reflected
            .push(deeper, rays, segments, segments.inside, BOUNCED);
        // Infinite densities mark specular rays
        if last != 0 {
            self.add_last(surface, last, packet);
        }
        packet.points.reflected.pdf = splat(f32::INFINITY);
    }

    /// Adds the light of the environment along the last segments of paths, which are `lanes` of the reflected rays.
    fn add_last(&self, surface: &Surface<'_>, lanes: u32, packet: &mut PacketScratch) {
        let Some(environment) = self.environment else {
            return;
        };
        let (rays, samples) = (&packet.points.reflected, &mut packet.light);
        samples.rays.origin = rays.origin;
        samples.rays.direction = rays.direction;
        samples.rays.t_min = splat(0.0);
        let (direction, throughput) = (&rays.direction, &rays.throughput);
        let radiance = &mut samples.radiance;
        let simd = self.context.simd;
        environment_along(
            simd,
            environment,
            direction,
            &rays.pdf,
            throughput,
            radiance,
        );
        let is_bright = |l| lane3(&samples.radiance, l).max_element() > 0.0;
        samples.lanes = lanes & lanes_where(is_bright);
        let is_traced = |l: usize| samples.lanes >> l & 1 == 1;
        samples.rays.t_max =
            std::array::from_fn(|l| if is_traced(l) { f32::INFINITY } else { -1.0 });
        self.add_unoccluded(surface, packet);
    }

    /// Ends some of the long paths in `lanes` at random, and compensates the throughput of the others. Returns the
    /// lanes of paths that continue.
    fn roulette(&self, surface: &Surface<'_>, lanes: u32, throughput: &mut Lanes3) -> u32 {
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
            let chance = along.max_element().min(MAX_CONTINUATION);
            if u[lane] < chance {
                set_lane3(throughput, lane, along / chance);
            } else {
                ended |= 1 << lane;
            }
        }
        lanes & !ended
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
        let context = &self.context;
        let (rays, hits, inside) = (&segments.rays, &packet.hits, segments.inside);
        let interface = &self.interface;
        interface.shading_points(context.simd, rays, hits, inside, &mut packet.points);
        // At the last specular surface, rays see the environment
        let max = context.settings.max_depth;
        let is_last = |l: usize| depth - segments.bounces[l] >= max;
        let hits = SpecularHits {
            segments,
            depth,
            lanes,
            last: lanes & lanes_where(is_last),
        };
        let constants = interface.constants();
        context.scatter(
            constants,
            &self.split,
            hits,
            packet,
            next,
            &|along, weight, lanes, sum| {
                if let Some(environment) = self.environment {
                    let (full, mut seen) = (splat(f32::INFINITY), [splat(0.0); 3]);
                    environment_along(context.simd, environment, along, &full, weight, &mut seen);
                    add(context.simd, &seen, &Vec3::ONE, lanes, sum);
                }
            },
        );
    }
}
