//! Matte surfaces: Lambert's law. The same fraction of the light, the albedo, leaves in every direction.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use std::f32::consts::FRAC_1_PI;

use super::{Bsdf, BsdfSamples, BsdfValues, SurfacePoints};
use crate::render::shading::{disc, to_world};
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matte;

impl Bsdf for Matte {
    fn eval(
        &self,
        simd: Supported,
        _rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    ) {
        eval_matte(simd, points, direction, lanes, values);
    }

    fn sample(
        &self,
        simd: Supported,
        _rays: &RayPacket,
        points: &SurfacePoints,
        u: &[Lanes; 2],
        lanes: u32,
        samples: &mut BsdfSamples,
    ) {
        sample_matte(simd, points, u, lanes, samples);
    }
}

#[inline(always)]
fn eval_matte_body(
    points: &SurfacePoints,
    direction: &Lanes3,
    lanes: u32,
    values: &mut BsdfValues,
) {
    for l in 0..LANES {
        let (mut cosine, mut above) = (0.0, 0.0);
        for axis in 0..3 {
            cosine += points.normal[axis][l] * direction[axis][l];
            above += points.geometric[axis][l] * direction[axis][l];
        }
        let is_visible = cosine > 0.0 && above > 0.0;
        let pdf = if is_visible { cosine * FRAC_1_PI } else { 0.0 };
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let value = points.albedo[axis][l] * pdf;
            values.value[axis][l] = if is_chosen { value } else { values.value[axis][l] };
        }
        values.pdf[l] = if is_chosen { pdf } else { values.pdf[l] };
    }
}

lane_kernel! {
    fn eval_matte(
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    ) = eval_matte_body;
}

#[inline(always)]
fn sample_matte_body(
    points: &SurfacePoints,
    u: &[Lanes; 2],
    lanes: u32,
    samples: &mut BsdfSamples,
) {
    for l in 0..LANES {
        // Project a point of the disc up to the hemisphere (Malley's method)
        let [x, y] = disc([u[0][l], u[1][l]]);
        let rest = 1.0 - x * x - y * y;
        let z = (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let n = [points.normal[0][l], points.normal[1][l], points.normal[2][l]];
        let direction = to_world([x, y, z], n);
        // Directions below the geometric surface have no light
        let mut above = 0.0;
        for axis in 0..3 {
            above += points.geometric[axis][l] * direction[axis];
        }
        let is_visible = z > 0.0 && above > 0.0;
        let pdf = if is_visible { z * FRAC_1_PI } else { 0.0 };
        // Write the chosen lanes; the density cancels the cosine, so the weight is the albedo
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let select = |new: f32, old: f32| if is_chosen { new } else { old };
            samples.direction[axis][l] = select(direction[axis], samples.direction[axis][l]);
            samples.weight[axis][l] = select(points.albedo[axis][l], samples.weight[axis][l]);
        }
        samples.pdf[l] = if is_chosen { pdf } else { samples.pdf[l] };
    }
}

lane_kernel! {
    fn sample_matte(
        points: &SurfacePoints,
        u: &[Lanes; 2],
        lanes: u32,
        samples: &mut BsdfSamples,
    ) = sample_matte_body;
}
