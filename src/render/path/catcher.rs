//! The shadow catcher: camera rays see nothing of the ground but shadows. The background behind it is multiplied by
//! 1 minus the lost fraction of the light. Only occluded samples are lost, and the whole light of the environment is
//! known: where nothing is in the way, the background is exact, without noise. In transparent images, the lost fraction
//! is coverage by black.
//!
//! The fraction from a single sample may exceed 1, but not its mean; `accumulate` bounds pixels. Transmissive particles
//! attenuate light in a straight line. Light that particles reflect to the ground is left out. All other rays see a
//! matte ground.

use glam::Vec3;

use super::{PathIntegrator, Surface, lanes_where};
use crate::math::{Lanes3, lane3, lanes_in, set_lane3, splat, splat3};
use crate::render::{
    bsdf::surface_points,
    dimensions::ENVIRONMENT,
    lights::{environment_along, sample_directions},
    sampler::get_2d_lanes,
    scratch::PacketScratch,
};
use crate::scene::environment::LUMINANCE;
use crate::scene::{Environment, Scene};

/// A shadow catcher and its light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Catcher {
    /// Strength of the shadows, 0 to 1.
    strength: f32,
    /// Radiance that a white ground reflects of the environment if nothing is in the way.
    environment: Vec3,
}

impl Catcher {
    /// The shadow catcher of `scene`, if there is one.
    pub(super) fn of(scene: &Scene) -> Option<Self> {
        let ground = scene.ground.as_ref()?;
        let environment = scene.environment.as_deref();
        let irradiance = environment.map_or(Vec3::ZERO, |e| e.irradiance(ground.up));
        Some(Self {
            strength: ground.shadow_catcher?,
            environment: irradiance * std::f32::consts::FRAC_1_PI,
        })
    }
}

/// Radiance that a white ground reflects.
struct CaughtLight {
    /// If nothing is in the way.
    whole: Lanes3,
    /// The part of it that something takes away.
    lost: Lanes3,
}

impl PathIntegrator<'_> {
    /// Darkens the throughput of the rays of `surface`, which hit a shadow catcher, and lets them pass.
    pub(super) fn catch_shadows(
        &self,
        catcher: &Catcher,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        // Reflect light as a white surface, and add up what does not arrive
        (packet.base, packet.weight) = (splat3(Vec3::ONE), splat3(Vec3::ONE));
        let (simd, rays) = (self.context.simd, &surface.segments.rays);
        let points = &mut packet.surface;
        surface_points(simd, rays, &packet.hits, &packet.base, points);
        let mut light = CaughtLight {
            whole: splat3(catcher.environment),
            lost: [splat(0.0); 3],
        };
        self.lose_environment(surface, packet, &mut light);
        self.lose_lights(surface, packet, &mut light);
        // Darken the background by the lost fraction
        let is_transparent = self.context.settings.transparent_background;
        for lane in lanes_in(surface.lanes) {
            let (whole, lost) = (lane3(&light.whole, lane), lane3(&light.lost, lane));
            let fraction = Vec3::select(whole.cmpgt(Vec3::ZERO), lost / whole, Vec3::ZERO);
            let shadow = catcher.strength * packet.hits.opacity[lane] * fraction;
            let throughput = lane3(&packet.throughput, lane) * (Vec3::ONE - shadow);
            set_lane3(&mut packet.throughput, lane, throughput);
            if is_transparent {
                packet.coverage[lane] = shadow.dot(LUMINANCE);
            }
        }
        packet.hits.mask &= !surface.lanes;
    }

    /// Adds the lost light of the environment, from one direction that it samples and one that the BSDF samples.
    fn lose_environment(
        &self,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        light: &mut CaughtLight,
    ) {
        let Some(environment) = self.environment else {
            return;
        };
        let (simd, path) = (self.context.simd, &surface.segments.path);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, path, ENVIRONMENT, &surface.sample, &mut u);
        sample_directions(simd, environment, &u, &mut packet.light.rays.direction);
        self.lose_along(environment, surface, packet, light);
        self.sample_bsdf(surface, packet);
        packet.light.rays.direction = packet.points.reflected.direction;
        self.lose_along(environment, surface, packet, light);
        // Infinite densities mark specular rays
        packet.points.reflected.pdf = splat(f32::INFINITY);
    }

    /// Adds the lost light of the environment along the directions of `packet.light`. On a white matte surface, the
    /// BSDF is its own density, so both ways to sample a direction give its light the same weight.
    fn lose_along(
        &self,
        environment: &Environment,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        light: &mut CaughtLight,
    ) {
        // Find the directions that something is in the way of, before any radiance is looked up
        self.eval(surface, packet);
        let PacketScratch {
            light: samples,
            bsdf,
            crossings,
            counts,
            surface: points,
            ..
        } = packet;
        let lanes = surface.lanes & lanes_where(|l| bsdf.pdf[l] > 0.0);
        let is_traced = |l: usize| lanes >> l & 1 == 1;
        samples.lanes = lanes;
        samples.radiance = splat3(Vec3::ONE);
        samples.rays.origin = points.start;
        samples.rays.t_min = splat(0.0);
        samples.rays.t_max =
            std::array::from_fn(|l| if is_traced(l) { f32::INFINITY } else { -1.0 });
        if lanes == 0 {
            return;
        }
        let (context, segments, depth) = (&self.context, surface.segments, surface.depth);
        let visible = context.trace_shadow_rays(segments, depth, samples, crossings, counts);
        let transmittance = |l: usize| match visible >> l & 1 {
            0 => Vec3::ZERO,
            _ => lane3(&samples.radiance, l),
        };
        let blocked = lanes & lanes_where(|l| transmittance(l) != Vec3::ONE);
        if blocked == 0 {
            return;
        }
        // Add their light
        let (direction, white) = (&samples.rays.direction, splat3(Vec3::ONE));
        let mut arriving = [splat(0.0); 3];
        let simd = context.simd;
        environment_along(
            simd,
            environment,
            direction,
            &bsdf.pdf,
            &white,
            &mut arriving,
        );
        for lane in lanes_in(blocked) {
            let lost = (Vec3::ONE - transmittance(lane)) * lane3(&arriving, lane);
            let sum = lane3(&light.lost, lane) + lost;
            set_lane3(&mut light.lost, lane, sum);
        }
    }

    /// Adds the light of all light sources and its lost part.
    fn lose_lights(
        &self,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        light: &mut CaughtLight,
    ) {
        for index in 0..self.context.lights.len() {
            self.reflect_light(index, false, surface, packet);
            for lane in lanes_in(packet.light.lanes) {
                let sum = lane3(&light.whole, lane) + lane3(&packet.light.radiance, lane);
                set_lane3(&mut light.whole, lane, sum);
            }
            if self.context.lights[index].casts_shadow() {
                self.add_lost(surface, packet, light);
            }
        }
    }

    /// Traces the shadow rays of `packet.light`, and adds what does not arrive.
    fn add_lost(&self, surface: &Surface<'_>, packet: &mut PacketScratch, light: &mut CaughtLight) {
        let PacketScratch {
            light: samples,
            crossings,
            counts,
            ..
        } = packet;
        let (lanes, unoccluded) = (samples.lanes, samples.radiance);
        if lanes == 0 {
            return;
        }
        let (segments, depth) = (surface.segments, surface.depth);
        let visible = (self.context).trace_shadow_rays(segments, depth, samples, crossings, counts);
        for lane in lanes_in(lanes) {
            let arriving = match visible >> lane & 1 {
                0 => Vec3::ZERO,
                _ => lane3(&samples.radiance, lane),
            };
            let lost = lane3(&unoccluded, lane) - arriving;
            let sum = lane3(&light.lost, lane) + lost;
            set_lane3(&mut light.lost, lane, sum);
        }
    }
}
