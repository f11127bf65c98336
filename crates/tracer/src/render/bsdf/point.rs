//! BSDFs that are written for one ray, and the loops over the lanes of a packet that all of them share.

#![expect(clippy::needless_range_loop, reason = "loops over lanes, several arrays at a time")]

use super::microfacet::dot;
use super::{Bsdf, BsdfSamples, BsdfValues, SurfacePoints};
use crate::render::shading::{tangents, to_world};
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel, lanes_in, larger};
use spherule_tree::ray::RayPacket;

/// Least cosine of the outgoing direction: rays may see a surface whose shading normal is turned away.
const MIN_COSINE: f32 = 1e-4;

/// A point on an opaque surface. Directions are unit vectors that lead away from it.
#[derive(Clone, Copy)]
pub(in crate::render) struct SurfacePoint {
    /// Shading normal, on the side of the ray.
    pub(super) normal: [f32; 3],
    /// Geometric normal, on the side of the ray.
    pub(super) geometric: [f32; 3],
    /// Base colour.
    pub(super) albedo: [f32; 3],
    /// The direction in which light leaves.
    pub(super) out: [f32; 3],
}

impl SurfacePoint {
    /// The point in lane `l`.
    #[inline(always)]
    fn at(rays: &RayPacket, points: &SurfacePoints, l: usize) -> Self {
        let d = lane(&rays.direction, l);
        Self {
            normal: lane(&points.normal, l),
            geometric: lane(&points.geometric, l),
            albedo: lane(&points.albedo, l),
            out: [-d[0], -d[1], -d[2]],
        }
    }

    /// Whether a direction leads above the geometric surface.
    #[inline(always)]
    pub(super) fn is_above(&self, direction: [f32; 3]) -> bool {
        dot(self.geometric, direction) > 0.0
    }

    /// A direction in the frame of the surface, whose z axis is the shading normal.
    #[inline(always)]
    fn local(&self, direction: [f32; 3]) -> [f32; 3] {
        let [s, t] = tangents(self.normal);
        [dot(direction, s), dot(direction, t), dot(direction, self.normal)]
    }

    /// The direction in which light leaves, in the frame of the surface.
    #[inline(always)]
    fn local_out(&self) -> [f32; 3] {
        let out = self.local(self.out);
        [out[0], out[1], larger(out[2], MIN_COSINE)]
    }
}

/// The component of each lane.
#[inline(always)]
fn lane(values: &Lanes3, l: usize) -> [f32; 3] {
    [values[0][l], values[1][l], values[2][l]]
}

/// A direction sampled at a point; see [`BsdfSamples`].
pub(super) struct PointSample {
    pub(super) direction: [f32; 3],
    pub(super) weight: [f32; 3],
    pub(super) pdf: f32,
}

/// Reflection of light at a point.
pub(in crate::render) trait PointBsdf: Sync {
    /// The BSDF times the cosine with the normal, for light from direction `into`, and the probability density with
    /// which the direction is sampled, per steradian.
    fn value(&self, at: &SurfacePoint, into: [f32; 3]) -> ([f32; 3], f32);
}

/// Reflection of light at a point, with directions in proportion to it.
pub(super) trait SampledBsdf: PointBsdf {
    /// A direction from which light may arrive. `u` is uniform in the unit square.
    fn sampled(&self, at: &SurfacePoint, u: [f32; 2]) -> PointSample;

    /// The diffuse part of the value, 0 to 1 per component.
    fn diffuse(&self, at: &SurfacePoint, into: [f32; 3]) -> [f32; 3] {
        let _ = (at, into);
        [1.0; 3]
    }
}

/// The same in the frame of the surface, whose z axis is the shading normal. Nothing is reflected below the surface.
pub(super) trait LocalBsdf: Sync {
    /// See [`PointBsdf::value`]. `base` is the base colour.
    fn value(&self, base: [f32; 3], out: [f32; 3], into: [f32; 3]) -> ([f32; 3], f32);

    /// A direction from which light may arrive that leaves in direction `out`. `u` is uniform in the unit square.
    fn direction(&self, base: [f32; 3], out: [f32; 3], u: [f32; 2]) -> [f32; 3];

    /// See [`SampledBsdf::diffuse`].
    fn diffuse_part(&self, base: [f32; 3], out: [f32; 3], into: [f32; 3]) -> [f32; 3];
}

impl<B: LocalBsdf> PointBsdf for B {
    #[inline(always)]
    fn value(&self, at: &SurfacePoint, world: [f32; 3]) -> ([f32; 3], f32) {
        let into = at.local(world);
        let is_visible = into[2] > 0.0 && at.is_above(world);
        let (value, pdf) = LocalBsdf::value(self, at.albedo, at.local_out(), into);
        let visible = |value: f32| if is_visible { value } else { 0.0 };
        ([visible(value[0]), visible(value[1]), visible(value[2])], visible(pdf))
    }
}

impl<B: LocalBsdf> SampledBsdf for B {
    #[inline(always)]
    fn sampled(&self, at: &SurfacePoint, u: [f32; 2]) -> PointSample {
        let (base, out) = (at.albedo, at.local_out());
        let into = self.direction(base, out, u);
        let direction = to_world(into, at.normal);
        let (value, pdf) = LocalBsdf::value(self, base, out, into);
        let is_visible = into[2] > 0.0 && at.is_above(direction) && pdf > 0.0;
        let weight = |value: f32| if is_visible { value / pdf } else { 0.0 };
        PointSample {
            direction,
            weight: [weight(value[0]), weight(value[1]), weight(value[2])],
            pdf: if is_visible { pdf } else { 0.0 },
        }
    }

    fn diffuse(&self, at: &SurfacePoint, into: [f32; 3]) -> [f32; 3] {
        self.diffuse_part(at.albedo, at.local_out(), at.local(into))
    }
}

impl<B: SampledBsdf> Bsdf for B {
    fn eval(
        &self,
        simd: Supported,
        rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    ) {
        eval_lanes(simd, self, rays, points, direction, lanes, values);
    }

    fn sample(
        &self,
        simd: Supported,
        rays: &RayPacket,
        points: &SurfacePoints,
        u: &[Lanes; 2],
        lanes: u32,
        samples: &mut BsdfSamples,
    ) {
        sample_lanes(simd, self, rays, points, u, lanes, samples);
    }

    fn diffuse_part(
        &self,
        rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        part: &mut Lanes3,
    ) {
        for l in lanes_in(lanes) {
            let diffuse = self.diffuse(&SurfacePoint::at(rays, points, l), lane(direction, l));
            for axis in 0..3 {
                part[axis][l] = diffuse[axis];
            }
        }
    }
}

#[inline(always)]
fn eval_body<B: PointBsdf>(
    bsdf: &B,
    rays: &RayPacket,
    points: &SurfacePoints,
    direction: &Lanes3,
    lanes: u32,
    values: &mut BsdfValues,
) {
    for l in 0..LANES {
        let (value, pdf) = bsdf.value(&SurfacePoint::at(rays, points, l), lane(direction, l));
        // Write the chosen lanes only
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let old = values.value[axis][l];
            values.value[axis][l] = if is_chosen { value[axis] } else { old };
        }
        values.pdf[l] = if is_chosen { pdf } else { values.pdf[l] };
    }
}

lane_kernel! {
    /// [`Bsdf::eval`].
    pub(in crate::render) fn eval_lanes<B: PointBsdf>(
        bsdf: &B,
        rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    ) = eval_body;
}

#[inline(always)]
fn sample_body<B: SampledBsdf>(
    bsdf: &B,
    rays: &RayPacket,
    points: &SurfacePoints,
    u: &[Lanes; 2],
    lanes: u32,
    samples: &mut BsdfSamples,
) {
    for l in 0..LANES {
        let sample = bsdf.sampled(&SurfacePoint::at(rays, points, l), [u[0][l], u[1][l]]);
        // Write the chosen lanes only
        let is_chosen = lanes >> l & 1 == 1;
        let select = |new: f32, old: f32| if is_chosen { new } else { old };
        for axis in 0..3 {
            let [direction, weight] = [sample.direction[axis], sample.weight[axis]];
            samples.direction[axis][l] = select(direction, samples.direction[axis][l]);
            samples.weight[axis][l] = select(weight, samples.weight[axis][l]);
        }
        samples.pdf[l] = select(sample.pdf, samples.pdf[l]);
    }
}

lane_kernel! {
    fn sample_lanes<B: SampledBsdf>(
        bsdf: &B,
        rays: &RayPacket,
        points: &SurfacePoints,
        u: &[Lanes; 2],
        lanes: u32,
        samples: &mut BsdfSamples,
    ) = sample_body;
}
