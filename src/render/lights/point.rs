//! Light from a place.

#![expect(
    clippy::needless_range_loop,
    reason = "one index for the lanes of many arrays"
)]

use glam::Vec3;

use super::light::{Light, LightSamples};
use crate::math::{LANES, Lanes3, Supported, lane_kernel};
use crate::scene::Falloff;

/// A light without extent.
#[derive(Debug, Clone, Copy)]
pub(super) struct PointLight {
    pub(super) position: Vec3,
    pub(super) falloff: Falloff,
    pub(super) intensity: Vec3,
    pub(super) casts_shadow: bool,
}

impl Light for PointLight {
    fn sample_li(&self, simd: Supported, start: &Lanes3, samples: &mut LightSamples) {
        sample_point_light(simd, self, start, samples);
    }

    fn casts_shadow(&self) -> bool {
        self.casts_shadow
    }
}

/// At the very place of the light the direction is no number, and nothing is lit.
#[inline(always)]
fn sample_point_light_body(light: &PointLight, start: &Lanes3, samples: &mut LightSamples) {
    let has_falloff = light.falloff == Falloff::InverseSquare;
    for l in 0..LANES {
        let mut v = [0.0; 3];
        for axis in 0..3 {
            v[axis] = light.position[axis] - start[axis][l];
        }
        let distance = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        let inverse = 1.0 / distance;
        let falloff = if has_falloff {
            1.0 / (distance * distance)
        } else {
            1.0
        };
        for axis in 0..3 {
            samples.rays.origin[axis][l] = start[axis][l];
            samples.rays.direction[axis][l] = v[axis] * inverse;
            samples.radiance[axis][l] = falloff * light.intensity[axis];
        }
        samples.rays.t_min[l] = 0.0;
        samples.rays.t_max[l] = distance;
    }
}

lane_kernel! {
    fn sample_point_light(light: &PointLight, start: &Lanes3, samples: &mut LightSamples) = sample_point_light_body;
}
