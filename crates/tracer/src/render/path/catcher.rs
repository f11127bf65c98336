//! The shadow catcher: camera rays see nothing of the ground but shadows. The background behind it is multiplied by
//! 1 minus the lost fraction of the light. Only occluded samples are lost, and the whole light of the environment is
//! known: where nothing is in the way, the background is exact, without noise. In transparent images, the lost fraction
//! is coverage by black.
//!
//! The fraction from a single sample may exceed 1, but not its mean; `accumulate` bounds pixels. Transmissive particles
//! attenuate light in a straight line. The light of sources that emit photons ends at them instead, and caustics are a
//! negative loss: they brighten the background, but add no coverage to transparent images. Light that opaque particles
//! reflect to the ground is left out.
//!
//! In transparent images, and in front of a visible environment, rays that metals and coats of plastic reflect see the
//! environment through the catcher, darkened in the same way: the plate has no grey floor. In front of another background,
//! and for all other rays, the catcher is a matte ground, which throws light back.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::{Occlusion, PathIntegrator, Surface};
use crate::render::{
    bsdf::surface_points,
    dimensions::ENVIRONMENT,
    lights::{environment_along, sample_directions},
    sampler::get_2d_lanes,
    scratch::PacketScratch,
    settings::RenderSettings,
    shading::add,
};
use crate::scene::environment::{EnvironmentTable, LUMINANCE};
use crate::scene::{Environment, Finish, Material, Scene};
use spherule_tree::math::{LANES, Lanes3, lane3, lanes_in, lanes_where, set_lane3, splat, splat3};
use spherule_tree::ray::RayPacket;

/// A shadow catcher and its light.
#[derive(Debug, Clone)]
pub(super) struct Catcher {
    /// Strength of the shadows, 0 to 1.
    strength: f32,
    /// The environment times the cosine with the ground: sampling it needs no BSDF, and a sample that is blocked loses
    /// about the same light whatever its direction.
    environment: Option<EnvironmentTable>,
    /// Radiance that a white ground reflects of the environment if nothing is in the way.
    whole: Vec3,
    /// Whether a material of the scene mirrors what is behind it.
    pub(super) is_mirrored: bool,
}

impl Catcher {
    /// The shadow catcher of `scene`, if there is one.
    pub(super) fn of(scene: &Scene, settings: &RenderSettings) -> Option<Self> {
        let ground = scene.ground.as_ref()?;
        let strength = ground.shadow_catcher?;
        let environment =
            scene.environment.as_deref().filter(|e| !e.is_black()).map(|e| light_on(e, ground.up));
        let whole = environment.as_ref().map_or(Vec3::ZERO, reflected_by_white);
        let is_mirrored = mirrors_see_through(scene, settings);
        Some(Self { strength, environment, whole, is_mirrored })
    }
}

/// Whether metals and coats of plastic see the environment through a shadow catcher: if nothing else is behind it.
pub fn mirrors_see_through(scene: &Scene, settings: &RenderSettings) -> bool {
    let is_glossy = |material: &Material| {
        matches!(material.finish, Finish::Plastic { .. } | Finish::Metal { .. })
    };
    scene.ground.as_ref().is_some_and(|ground| ground.shadow_catcher.is_some())
        && (settings.transparent_background || scene.is_environment_visible)
        && scene.materials.iter().any(is_glossy)
}

/// The light of an environment on a surface with unit normal `up`.
pub fn light_on(environment: &Environment, up: Vec3) -> EnvironmentTable {
    environment.table().times_cosine(up)
}

/// The radiance that a white surface reflects of [`light_on`] it.
pub fn reflected_by_white(light: &EnvironmentTable) -> Vec3 {
    light.flux() * FRAC_1_PI
}

/// Radiance that a white ground reflects.
struct CaughtLight {
    /// If nothing is in the way.
    whole: Lanes3,
    /// The part of it that something takes away.
    lost: Lanes3,
}

impl CaughtLight {
    /// The part of the light in `lane` that is lost.
    fn lost_part(&self, lane: usize) -> Vec3 {
        let (whole, lost) = (lane3(&self.whole, lane), lane3(&self.lost, lane));
        Vec3::select(whole.cmpgt(Vec3::ZERO), lost / whole, Vec3::ZERO)
    }
}

impl PathIntegrator<'_> {
    /// Darkens the throughput of the rays of `surface`, which hit a shadow catcher, and lets them pass.
    pub(super) fn catch_shadows(
        &self,
        catcher: &Catcher,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        let light = self.caught_light(catcher, surface, packet);
        // Darken the background by the lost fraction
        let is_transparent = self.context.settings.transparent_background;
        for lane in lanes_in(surface.lanes) {
            let (whole, lost) = (lane3(&light.whole, lane), lane3(&light.lost, lane));
            packet.split.set_lost(lane, whole, lost);
            let shadow = catcher.strength * packet.hits.opacity[lane] * light.lost_part(lane);
            if let Some(caught) = &mut packet.split.shadow_loss {
                set_lane3(caught, lane, (1.0 - packet.coverage[lane]) * shadow);
            }
            let throughput = lane3(&packet.throughput, lane) * (Vec3::ONE - shadow);
            set_lane3(&mut packet.throughput, lane, throughput);
            if is_transparent {
                // Walls of glass may cover some of it already
                let covered = packet.coverage[lane];
                packet.coverage[lane] = covered + (1.0 - covered) * shadow.dot(LUMINANCE);
            }
        }
        packet.hits.mask &= !surface.lanes;
    }

    /// Adds the environment behind the catcher, darker in shadows, as far as the rays of `surface` come from a glossy
    /// reflection. The diffuse part meets the catcher as a matte ground, which has its light.
    pub(super) fn see_through(
        &self,
        catcher: &Catcher,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        let segments = surface.segments;
        let diffuse = |l: usize| lane3(&segments.diffuse, l);
        let lanes = surface.lanes & lanes_where(|l| diffuse(l) != Vec3::ONE);
        if lanes == 0 {
            return;
        }
        let surface = &Surface { lanes, ..*surface };
        let light = self.caught_light(catcher, surface, packet);
        let mut along = [splat(0.0); 3];
        for lane in lanes_in(lanes) {
            let throughput = lane3(&packet.throughput, lane);
            let shadow = Vec3::ONE - catcher.strength * light.lost_part(lane);
            let glossy = Vec3::ONE - diffuse(lane);
            set_lane3(&mut along, lane, throughput * glossy * shadow * packet.hits.opacity[lane]);
            set_lane3(&mut packet.throughput, lane, throughput * diffuse(lane));
        }
        // Light samples do not find the environment there, so that these rays have the full weight
        if let Some(environment) = self.environment {
            let (simd, mut seen) = (self.context.simd, [splat(0.0); 3]);
            let rays = [&segments.rays.direction, &along];
            environment_along(simd, environment, rays, &splat(f32::INFINITY), lanes, &mut seen);
            add(simd, &seen, &Vec3::ONE, lanes, &mut packet.radiance);
            packet.groups.add(simd, self.context.environment_group(), &seen, lanes);
        }
        packet.hits.mask &= !(lanes & lanes_where(|l| diffuse(l) == Vec3::ZERO));
    }

    /// The light that a white ground reflects at the points of `surface`, and what something takes away.
    fn caught_light(
        &self,
        catcher: &Catcher,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) -> CaughtLight {
        // Reflect light as a white surface, and add up what does not arrive
        (packet.base, packet.weight) = (splat3(Vec3::ONE), splat3(Vec3::ONE));
        let (simd, rays) = (self.context.simd, &surface.segments.rays);
        let points = &mut packet.surface;
        surface_points(simd, rays, &packet.hits, &packet.base, points);
        let mut light = CaughtLight { whole: splat3(catcher.whole), lost: [splat(0.0); 3] };
        // Add the light that is lost from each source; that which mist takes is not lost to a shadow
        packet.light.ignores_mist = true;
        if let Some(environment) = &catcher.environment {
            self.lose_environment(environment, surface, packet, &mut light);
        }
        self.lose_lights(surface, packet, &mut light);
        packet.light.ignores_mist = false;
        // Caustics bring some of it back
        if let Some(caustics) = &self.caustics.catcher {
            for lane in lanes_in(surface.lanes) {
                let caustics = caustics.white(lane3(&packet.hits.point, lane));
                let lost = lane3(&light.lost, lane) - caustics;
                set_lane3(&mut light.lost, lane, lost);
            }
        }
        light
    }

    /// Adds the lost light of the `environment` of a catcher.
    fn lose_environment(
        &self,
        environment: &EnvironmentTable,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        light: &mut CaughtLight,
    ) {
        // Sample directions
        let (simd, path) = (self.context.simd, &surface.segments.path);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, path, ENVIRONMENT, &surface.sample, &mut u);
        let PacketScratch { light: samples, crossings, counts, surface: points, .. } = packet;
        let mut texel = [0; LANES];
        sample_directions(simd, environment, &u, &mut samples.rays.direction, &mut texel);
        // Find out whether something is in their way
        let direction = |rays: &RayPacket, l: usize| lane3(&rays.direction, l);
        let is_above = |l| direction(&samples.rays, l).dot(lane3(&points.normal, l)) > 0.0;
        let lanes = surface.lanes & lanes_where(is_above);
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
        for lane in lanes_in(blocked) {
            let (arriving, pdf) = environment.texel(texel[lane]);
            let lost = (Vec3::ONE - transmittance(lane)) * arriving * (FRAC_1_PI / pdf);
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
            let source = &self.context.lights[index];
            let occlusion = match self.caustics.catcher {
                Some(_) => Occlusion::beside_photons(&**source),
                None => Occlusion::of(&**source),
            };
            if !matches!(occlusion, Occlusion::None) {
                self.add_lost(occlusion, surface, packet, light);
            }
        }
    }

    /// Traces the shadow rays of `packet.light`, and adds what does not arrive.
    fn add_lost(
        &self,
        occlusion: Occlusion,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
        light: &mut CaughtLight,
    ) {
        let (lanes, unoccluded) = (packet.light.lanes, packet.light.radiance);
        if lanes == 0 {
            return;
        }
        let visible = self.trace_samples(occlusion, surface, packet);
        for lane in lanes_in(lanes) {
            let arriving = match visible >> lane & 1 {
                0 => Vec3::ZERO,
                _ => lane3(&packet.light.radiance, lane),
            };
            let lost = lane3(&unoccluded, lane) - arriving;
            let sum = lane3(&light.lost, lane) + lost;
            set_lane3(&mut light.lost, lane, sum);
        }
    }
}
