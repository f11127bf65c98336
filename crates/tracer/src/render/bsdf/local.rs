//! BSDFs that are written for one ray in the frame of the surface, whose z axis is the normal.

#![expect(clippy::needless_range_loop, reason = "loops over lanes, several arrays at a time")]

use super::microfacet::dot;
use super::{BsdfSamples, BsdfValues, SurfacePoints};
use crate::render::shading::{tangents, to_world};
use spherule_tree::math::{LANES, Lanes, Lanes3, lanes_in, larger};
use spherule_tree::ray::RayPacket;

/// Least cosine of the outgoing direction: rays may see a surface whose shading normal is turned away.
const MIN_COSINE: f32 = 1e-4;

/// Reflection of light at one point. Directions are unit vectors that lead away from the surface, `base` is the base
/// colour.
pub(super) trait LocalBsdf: Sync {
    /// The BSDF times the cosine of `into` for light from there that leaves in direction `out`, and the probability
    /// density with which [`LocalBsdf::direction`] returns `into`, per steradian.
    fn value(&self, base: [f32; 3], out: [f32; 3], into: [f32; 3]) -> ([f32; 3], f32);

    /// A direction from which light may arrive that leaves in direction `out`. `u` is uniform in the unit square.
    fn direction(&self, base: [f32; 3], out: [f32; 3], u: [f32; 2]) -> [f32; 3];

    /// The diffuse part of the value, 0 to 1 per component.
    fn diffuse_part(&self, base: [f32; 3], out: [f32; 3], into: [f32; 3]) -> [f32; 3];
}

/// The component of each lane.
#[inline(always)]
fn lane(values: &Lanes3, l: usize) -> [f32; 3] {
    [values[0][l], values[1][l], values[2][l]]
}

/// The direction against the ray in lane `l`, in the frame of the surface with the normal `n`.
#[inline(always)]
fn outgoing(rays: &RayPacket, l: usize, n: [f32; 3]) -> [f32; 3] {
    let d = lane(&rays.direction, l);
    let out = to_local([-d[0], -d[1], -d[2]], n);
    [out[0], out[1], larger(out[2], MIN_COSINE)]
}

#[inline(always)]
fn to_local(v: [f32; 3], n: [f32; 3]) -> [f32; 3] {
    let [s, t] = tangents(n);
    [dot(v, s), dot(v, t), dot(v, n)]
}

/// [`super::Bsdf::eval`].
#[inline(always)]
pub(super) fn eval_body<B: LocalBsdf>(
    bsdf: &B,
    rays: &RayPacket,
    points: &SurfacePoints,
    direction: &Lanes3,
    lanes: u32,
    values: &mut BsdfValues,
) {
    for l in 0..LANES {
        // Evaluate in the frame of the shading normal
        let n = lane(&points.normal, l);
        let world = lane(direction, l);
        let into = to_local(world, n);
        let above = dot(lane(&points.geometric, l), world);
        let is_visible = into[2] > 0.0 && above > 0.0;
        let (value, pdf) = bsdf.value(lane(&points.albedo, l), outgoing(rays, l, n), into);
        // Write the chosen lanes only; below either surface nothing is reflected
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let new = if is_visible { value[axis] } else { 0.0 };
            let old = values.value[axis][l];
            values.value[axis][l] = if is_chosen { new } else { old };
        }
        let new = if is_visible { pdf } else { 0.0 };
        values.pdf[l] = if is_chosen { new } else { values.pdf[l] };
    }
}

/// [`super::Bsdf::sample`].
#[inline(always)]
pub(super) fn sample_body<B: LocalBsdf>(
    bsdf: &B,
    rays: &RayPacket,
    points: &SurfacePoints,
    u: &[Lanes; 2],
    lanes: u32,
    samples: &mut BsdfSamples,
) {
    for l in 0..LANES {
        // Sample a direction in the frame of the shading normal
        let n = lane(&points.normal, l);
        let (base, out) = (lane(&points.albedo, l), outgoing(rays, l, n));
        let into = bsdf.direction(base, out, [u[0][l], u[1][l]]);
        let world = to_world(into, n);
        // Directions below either surface have no light
        let above = dot(lane(&points.geometric, l), world);
        let is_visible = into[2] > 0.0 && above > 0.0;
        let (value, pdf) = bsdf.value(base, out, into);
        let is_visible = is_visible && pdf > 0.0;
        // Write the chosen lanes only
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let select = |new: f32, old: f32| if is_chosen { new } else { old };
            let weight = if is_visible { value[axis] / pdf } else { 0.0 };
            samples.direction[axis][l] = select(world[axis], samples.direction[axis][l]);
            samples.weight[axis][l] = select(weight, samples.weight[axis][l]);
        }
        let new = if is_visible { pdf } else { 0.0 };
        samples.pdf[l] = if is_chosen { new } else { samples.pdf[l] };
    }
}

/// [`super::Bsdf::diffuse_part`].
pub(super) fn diffuse_part<B: LocalBsdf>(
    bsdf: &B,
    rays: &RayPacket,
    points: &SurfacePoints,
    direction: &Lanes3,
    lanes: u32,
    part: &mut Lanes3,
) {
    for l in lanes_in(lanes) {
        let n = lane(&points.normal, l);
        let into = to_local(lane(direction, l), n);
        let (base, out) = (lane(&points.albedo, l), outgoing(rays, l, n));
        let diffuse = bsdf.diffuse_part(base, out, into);
        for axis in 0..3 {
            part[axis][l] = diffuse[axis];
        }
    }
}

/// Implements [`super::Bsdf`] for a [`LocalBsdf`], with kernels of these names.
macro_rules! lane_bsdf {
    ($bsdf:ty, $eval:ident, $sample:ident) => {
        impl $crate::render::bsdf::Bsdf for $bsdf {
            fn eval(
                &self,
                simd: spherule_tree::math::Supported,
                rays: &spherule_tree::ray::RayPacket,
                points: &$crate::render::bsdf::SurfacePoints,
                direction: &spherule_tree::math::Lanes3,
                lanes: u32,
                values: &mut $crate::render::bsdf::BsdfValues,
            ) {
                $eval(simd, self, rays, points, direction, lanes, values);
            }

            fn sample(
                &self,
                simd: spherule_tree::math::Supported,
                rays: &spherule_tree::ray::RayPacket,
                points: &$crate::render::bsdf::SurfacePoints,
                u: &[spherule_tree::math::Lanes; 2],
                lanes: u32,
                samples: &mut $crate::render::bsdf::BsdfSamples,
            ) {
                $sample(simd, self, rays, points, u, lanes, samples);
            }

            fn diffuse_part(
                &self,
                rays: &spherule_tree::ray::RayPacket,
                points: &$crate::render::bsdf::SurfacePoints,
                direction: &spherule_tree::math::Lanes3,
                lanes: u32,
                part: &mut spherule_tree::math::Lanes3,
            ) {
                $crate::render::bsdf::local::diffuse_part(
                    self, rays, points, direction, lanes, part,
                );
            }
        }

        spherule_tree::math::lane_kernel! {
            fn $eval(
                bsdf: &$bsdf,
                rays: &spherule_tree::ray::RayPacket,
                points: &$crate::render::bsdf::SurfacePoints,
                direction: &spherule_tree::math::Lanes3,
                lanes: u32,
                values: &mut $crate::render::bsdf::BsdfValues,
            ) = $crate::render::bsdf::local::eval_body;
        }

        spherule_tree::math::lane_kernel! {
            fn $sample(
                bsdf: &$bsdf,
                rays: &spherule_tree::ray::RayPacket,
                points: &$crate::render::bsdf::SurfacePoints,
                u: &[spherule_tree::math::Lanes; 2],
                lanes: u32,
                samples: &mut $crate::render::bsdf::BsdfSamples,
            ) = $crate::render::bsdf::local::sample_body;
        }
    };
}
pub(super) use lane_bsdf;
