//! Foam and spray: white scattering without a hard boundary between lit and unlit. Light is scattered from both sides
//! of the surface, the more the closer it is to the normal (wrapped diffuse reflection: Miller et al., "Interactive
//! Editing and Modeling of Bidirectional Texture Functions", in a form that conserves energy).
//!
//! With the cosine `c` between light and normal, the value is `albedo * (c + w) / (pi * (1 + w)^2)` for `c` above `-w`.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use std::f32::consts::{FRAC_1_PI, PI};

use super::{Bsdf, BsdfSamples, BsdfValues, SurfacePoints};
use crate::render::shading::to_world;
use spherule_tree::math::functions::sin_cos;
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// Distance by which light wraps around the silhouette, 0 (matte) to 1 (from all directions); tuned by eye.
const WRAP: f32 = 0.7;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Foam;

impl Bsdf for Foam {
    fn eval(
        &self,
        simd: Supported,
        _rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    ) {
        eval_foam(simd, points, direction, lanes, values);
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
        sample_foam(simd, points, u, lanes, samples);
    }
}

/// The value for the albedo 1, which is the probability density of the direction.
#[inline(always)]
fn density(cosine: f32) -> f32 {
    let above = cosine + WRAP;
    let above = if above > 0.0 { above } else { 0.0 };
    above * (FRAC_1_PI / ((1.0 + WRAP) * (1.0 + WRAP)))
}

#[inline(always)]
fn eval_foam_body(points: &SurfacePoints, direction: &Lanes3, lanes: u32, values: &mut BsdfValues) {
    for l in 0..LANES {
        let mut cosine = 0.0;
        for axis in 0..3 {
            cosine += points.normal[axis][l] * direction[axis][l];
        }
        let pdf = density(cosine);
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let value = points.albedo[axis][l] * pdf;
            let old = values.value[axis][l];
            values.value[axis][l] = if is_chosen { value } else { old };
        }
        values.pdf[l] = if is_chosen { pdf } else { values.pdf[l] };
    }
}

lane_kernel! {
    fn eval_foam(
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    ) = eval_foam_body;
}

#[inline(always)]
fn sample_foam_body(points: &SurfacePoints, u: &[Lanes; 2], lanes: u32, samples: &mut BsdfSamples) {
    for l in 0..LANES {
        // The part of the light below a cosine c is ((c + w) / (1 + w))^2
        let z = (1.0 + WRAP) * u[0][l].sqrt() - WRAP;
        let rest = 1.0 - z * z;
        let level = (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let (sin, cos) = sin_cos(2.0 * PI * u[1][l]);
        let n = [points.normal[0][l], points.normal[1][l], points.normal[2][l]];
        let direction = to_world([level * cos, level * sin, z], n);
        let is_chosen = lanes >> l & 1 == 1;
        for axis in 0..3 {
            let select = |new: f32, old: f32| if is_chosen { new } else { old };
            samples.direction[axis][l] = select(direction[axis], samples.direction[axis][l]);
            samples.weight[axis][l] = select(points.albedo[axis][l], samples.weight[axis][l]);
        }
        let pdf = density(z);
        samples.pdf[l] = if is_chosen { pdf } else { samples.pdf[l] };
    }
}

lane_kernel! {
    fn sample_foam(
        points: &SurfacePoints,
        u: &[Lanes; 2],
        lanes: u32,
        samples: &mut BsdfSamples,
    ) = sample_foam_body;
}
