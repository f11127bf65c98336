//! Wet ground at the waterline: where the fluid touches the ground, or is within about a particle radius of it, the
//! ground is darker, and glossy beside the fluid.
//!
//! Light that a wet ground scatters is totally reflected at the surface of the water film above it, and hits the ground
//! once more; and less light is reflected where water touches the grains (Lekner and Dorf, "Why some things are darker
//! when wet", 1988).

use glam::Vec3;
use rayon::prelude::*;

use super::super::{Occlusion, PathIntegrator, Surface};
use super::{Map, Square};
use crate::render::{
    dimensions::WET, layers::LightClass, sampler::get_2d_lanes, scratch::PacketScratch,
    shading::in_cone, stop::Stop,
};
use crate::scene::WetGround;
use crate::scene::material::{dielectric, schlick};
use spherule_surface::{Shape, Side};
use spherule_tree::math::{Lanes, lane3, lanes_in, lanes_where, set_lane3, splat};
use spherule_tree::ray::Ray;

/// Texels along an edge of the map.
const SIDE: usize = 512;

/// Memory for the map, before and after it is widened.
pub(super) const BYTES: u64 = (SIDE * SIDE * (size_of::<Vec3>() + 2 * size_of::<f32>())) as u64;

/// Height above the ground from which rays look for fluid, as a fraction of the edge of the map.
const START: f32 = 1e-5;

/// Distance up to which the ground beside the fluid is fully wet, and from which on it is dry, in margins.
const SPREAD: [f32; 2] = [0.5, 1.5];

/// The same in texels at most, because the time to widen the map grows with the square of it; and the least distance,
/// for smooth edges.
const MAX_SPREAD: f32 = 16.0;
const MIN_SPREAD: f32 = 1.5;

/// Relative index of refraction of mineral grains in air.
const GRAIN_IOR: f32 = 1.5;

/// 1 minus the cosine of the angle by which reflections at wet ground are blurred, 12 degrees.
const BLUR: f32 = 0.022;

/// Least weight of a reflection that is traced.
const MIN_GLOSS: f32 = 1.0 / 256.0;

/// Where the ground is wet.
#[derive(Debug, Clone)]
pub(super) struct WetMap {
    square: Square,
    /// Wetness from 0 to 1, and the part of it that is not under fluid.
    map: Map,
    film: Film,
}

/// The optics of water on grains.
#[derive(Debug, Clone, Copy)]
struct Film {
    /// Part of diffuse light that the surface of the water reflects, from outside and from inside.
    outer: f32,
    inner: f32,
    /// Light that enters wet grains over that which enters dry ones.
    entering: f32,
    r0: f32,
    strength: f32,
}

impl Film {
    fn new(ior: f32, strength: f32) -> Self {
        let outer = diffuse_reflectance(ior);
        let into_grains = |ior: f32| 1.0 - diffuse_reflectance(ior);
        let root = (1.0 - ior) / (1.0 + ior);
        Self {
            outer,
            inner: (1.0 - (1.0 - outer) / (ior * ior)).clamp(0.0, 1.0),
            entering: into_grains((GRAIN_IOR / ior).max(1.0)) / into_grains(GRAIN_IOR),
            r0: root * root,
            strength,
        }
    }

    /// The albedo of wet ground, from that of dry ground.
    fn wet(&self, albedo: f32) -> f32 {
        let albedo = albedo.clamp(0.0, 1.0);
        // The part of the light that grains absorb grows with the part that enters them
        let absorbed = 1.0 - albedo;
        let absorbed = (absorbed * (albedo * self.entering + absorbed)).min(1.0);
        let grains = 1.0 - absorbed;
        (1.0 - self.outer) * grains * (1.0 - self.inner) / (1.0 - self.inner * grains).max(1e-6)
    }

    /// The albedo of ground with a `wetness` from 0 to 1.
    fn albedo(&self, albedo: Vec3, wetness: f32) -> Vec3 {
        let wet = Vec3::from_array(albedo.to_array().map(|part| self.wet(part)));
        albedo.lerp(wet.min(albedo), self.strength * wetness)
    }
}

/// The part of light from all directions that a surface reflects, for the relative index of refraction behind it.
fn diffuse_reflectance(ior: f32) -> f32 {
    const STEPS: u16 = 256;
    let part = |step: u16| {
        let cosine = (f32::from(step) + 0.5) / f32::from(STEPS);
        2.0 * cosine * dielectric(cosine, 1.0 / ior)
    };
    (0..STEPS).map(part).sum::<f32>() / f32::from(STEPS)
}

/// The fluid above a point of the ground.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Fluid {
    /// 1 with fluid right above, 0 without fluid within the margin.
    near: f32,
    /// Whether the point is in the fluid.
    covers: bool,
}

/// What is needed to find the fluid above the ground.
pub(super) struct WetScene<'a> {
    /// The bodies of fluid.
    pub(super) bodies: Vec<&'a dyn Shape>,
    pub(super) wet: &'a WetGround,
    pub(super) square: &'a Square,
    /// Corners of the box of the particles.
    pub(super) particles: [Vec3; 2],
    /// Index of refraction of the fluid.
    pub(super) ior: f32,
}

impl WetScene<'_> {
    /// Where the fluid wets the ground. `None` if `stop` is raised.
    pub(super) fn map(&self, stop: &dyn Stop) -> Option<WetMap> {
        // Find where the fluid is
        let row = |y: usize| {
            let texel = |x: usize| self.fluid_at([x, y].map(center));
            (!stop.is_raised()).then(|| (0..SIDE).map(texel).collect::<Vec<Fluid>>())
        };
        let rows: Option<Vec<_>> = (0..SIDE).into_par_iter().map(row).collect();
        let fluid = rows?.concat();
        // Spread its wetness over a margin
        let margin = self.wet.margin / self.square.edge * SIDE as f32;
        let [inner, outer] = SPREAD.map(|part| part * margin);
        let outer = outer.clamp(MIN_SPREAD, MAX_SPREAD);
        let near: Vec<f32> = fluid.iter().map(|fluid| fluid.near).collect();
        let wetness = widened(&near, [inner.min(0.5 * outer), outer]);
        // Ground is glossy where it is wet and not under the fluid
        let texel = |(wetness, fluid): (f32, &Fluid)| {
            let gloss = if fluid.covers { 0.0 } else { wetness };
            Vec3::new(wetness, gloss, 0.0)
        };
        Some(WetMap {
            square: *self.square,
            map: Map { side: SIDE, texels: wetness.into_iter().zip(&fluid).map(texel).collect() },
            film: Film::new(self.ior, self.wet.strength),
        })
    }

    fn fluid_at(&self, position: [f32; 2]) -> Fluid {
        let (up, margin) = (self.square.normal, self.wet.margin);
        let point = self.square.point(position);
        // There is no fluid beside the particles
        let [min, max] = self.particles;
        let beside = point.clamp(min, max) - point;
        if (beside - beside.dot(up) * up).length() > margin {
            return Fluid::default();
        }
        let above = point + START * self.square.edge * up;
        if self.bodies.iter().any(|body| body.side_of(above) == Side::Inside) {
            return Fluid { near: 1.0, covers: true };
        }
        let ray = Ray { t_max: margin, ..Ray::new(above, up) };
        let heights = self.bodies.iter().filter_map(|body| body.nearest(&ray)).map(|hit| hit.t);
        let near = heights.reduce(f32::min).map_or(0.0, |height| 2.0 * (1.0 - height / margin));
        Fluid { near: near.clamp(0.0, 1.0), covers: false }
    }
}

/// The position of the centre of a texel.
fn center(texel: usize) -> f32 {
    (texel as f32 + 0.5) / SIDE as f32
}

/// The greatest of the values around each texel, with weights that fall off smoothly from 1 at the `inner` to 0 at the
/// `outer` distance in texels.
fn widened(values: &[f32], [inner, outer]: [f32; 2]) -> Vec<f32> {
    #[expect(clippy::cast_possible_truncation, reason = "at most MAX_SPREAD")]
    let reach = outer.ceil() as isize;
    // Compute the weight at each offset
    let mut offsets = Vec::new();
    for y in -reach..=reach {
        for x in -reach..=reach {
            let distance = ((x * x + y * y) as f32).sqrt();
            let part = ((outer - distance) / (outer - inner)).clamp(0.0, 1.0);
            if part > 0.0 {
                offsets.push((x, y, part * part * (3.0 - 2.0 * part)));
            }
        }
    }
    // Only texels near those with a value get one
    let margin = reach.unsigned_abs();
    let places = (0_usize..).zip(values).filter(|(_, value)| **value > 0.0);
    let bounds = places.fold([[SIDE, 0]; 2], |bounds, (place, _)| {
        let place: [usize; 2] = [place % SIDE, place / SIDE];
        [0, 1].map(|axis| {
            let [first, last] = bounds[axis];
            [place[axis].min(first), place[axis].max(last)]
        })
    });
    let is_near = |at: usize, [first, last]: [usize; 2]| {
        first <= last && at + margin >= first && at <= last + margin
    };
    // Find the greatest weighted value around each texel
    let row = |y: usize| {
        let greatest = |x: usize| {
            if !is_near(x, bounds[0]) || !is_near(y, bounds[1]) {
                return 0.0;
            }
            // No value is above 1, and the weight of the texel itself is 1
            if values[y * SIDE + x] >= 1.0 {
                return 1.0;
            }
            offsets.iter().fold(0.0_f32, |most, (dx, dy, weight)| {
                match (x.checked_add_signed(*dx), y.checked_add_signed(*dy)) {
                    (Some(x), Some(y)) if x < SIDE && y < SIDE => {
                        most.max(weight * values[y * SIDE + x])
                    }
                    _ => most,
                }
            })
        };
        (0..SIDE).map(greatest).collect::<Vec<f32>>()
    };
    let rows: Vec<Vec<f32>> = (0..SIDE).into_par_iter().map(row).collect();
    rows.concat()
}

impl WetMap {
    /// Wetness at a point of the ground from 0 to 1, and the part of it that is not under fluid.
    fn at(&self, point: Vec3) -> [f32; 2] {
        let Some((position, _)) = self.square.place(point) else {
            return [0.0; 2];
        };
        let texel = self.map.at(position);
        [texel.x, texel.y]
    }

    /// Darkens the albedo of the points of a `surface` of the ground where it is wet. Returns the gloss of each point.
    pub(super) fn darken(&self, surface: &Surface<'_>, packet: &mut PacketScratch) -> Lanes {
        let mut gloss = splat(0.0);
        for lane in lanes_in(surface.lanes) {
            let [wetness, uncovered] = self.at(lane3(&packet.hits.point, lane));
            gloss[lane] = self.film.strength * uncovered;
            if wetness > 0.0 {
                let dry = lane3(&packet.surface.albedo, lane);
                let wet = self.film.albedo(dry, wetness);
                set_lane3(&mut packet.surface.albedo, lane, wet);
            }
        }
        gloss
    }
}

impl PathIntegrator<'_> {
    /// Adds the light of the environment that water between the grains of a wet ground reflects, by its `gloss`.
    pub(super) fn add_gloss(
        &self,
        map: &WetMap,
        gloss: &Lanes,
        surface: &Surface<'_>,
        packet: &mut PacketScratch,
    ) {
        let Some(environment) = self.environment else {
            return;
        };
        // Find the wet points that are not under water
        let is_glossy = |lane: usize| gloss[lane] > MIN_GLOSS;
        let lanes = surface.lanes & !surface.segments.inside & lanes_where(is_glossy);
        if lanes == 0 {
            return;
        }
        // Reflect the rays there
        let (simd, path) = (self.context.simd, &surface.segments.path);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(simd, path, WET, &surface.sample, &mut u);
        let samples = &mut packet.light;
        samples.rays.origin = packet.surface.start;
        samples.rays.t_min = splat(0.0);
        samples.rays.t_max = splat(-1.0);
        samples.lanes = 0;
        for lane in lanes_in(lanes) {
            let normal = lane3(&packet.surface.normal, lane);
            let direction = lane3(&surface.segments.rays.direction, lane);
            let cosine = -direction.dot(normal);
            let reflected = (direction + 2.0 * cosine * normal).normalize_or(normal);
            let blurred = in_cone(reflected.to_array(), BLUR, [u[0][lane], u[1][lane]]);
            let blurred = Vec3::from_array(blurred);
            if blurred.dot(normal) <= 0.0 {
                continue;
            }
            let part = gloss[lane] * schlick(map.film.r0, cosine);
            let light = part * environment.radiance(blurred);
            set_lane3(&mut samples.rays.direction, lane, blurred);
            set_lane3(&mut samples.radiance, lane, lane3(&packet.weight, lane) * light);
            samples.rays.t_max[lane] = f32::INFINITY;
            samples.lanes |= 1 << lane;
        }
        // Add the light of those that nothing blocks
        if samples.lanes != 0 {
            let group = self.context.environment_group();
            self.add_visible(Occlusion::Opaque, group, surface, packet);
        }
        packet.take_light(LightClass::Specular);
    }
}

#[cfg(test)]
#[path = "wet_tests.rs"]
mod tests;
