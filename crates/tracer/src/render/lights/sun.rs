//! A light at infinite distance with an angular size: directions in a cone, uniform in solid angle.

use std::f32::consts::PI;

use glam::Vec3;

use super::light::{Beam, Emission, Light, LightSamples, PhotonSource};
use crate::render::shading::in_cone;
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct SunLight {
    /// Unit vector towards the centre.
    to_light: Vec3,
    /// 1 minus the cosine of half the apparent diameter.
    cap: f32,
    irradiance: Vec3,
    radiance: Vec3,
    is_visible: bool,
}

impl SunLight {
    /// A sun with half the apparent diameter `half_angle`, in radians, and an `irradiance` on surfaces that face it.
    pub(super) fn new(to_light: Vec3, half_angle: f64, irradiance: Vec3, is_visible: bool) -> Self {
        // Without cancellation for small angles
        let (sin, half_sin) = (libm::sin(half_angle), libm::sin(0.5 * half_angle));
        #[expect(clippy::cast_possible_truncation, reason = "the renderer works in f32")]
        let narrow = |value: f64| value as f32;
        Self {
            to_light,
            cap: narrow(2.0 * half_sin * half_sin),
            irradiance,
            radiance: irradiance * narrow(1.0 / (std::f64::consts::PI * sin * sin)),
            is_visible,
        }
    }
}

impl Light for SunLight {
    fn sample_li(
        &self,
        simd: Supported,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        sample_sun(simd, self, start, u, samples);
    }

    fn has_extent(&self) -> bool {
        true
    }

    fn photon_source(&self) -> Option<PhotonSource> {
        Some(PhotonSource::Distant(Beam {
            to_light: self.to_light,
            cap: self.cap,
            irradiance: self.irradiance,
        }))
    }

    fn is_visible(&self) -> bool {
        self.is_visible
    }

    fn intersect(&self, simd: Supported, rays: &RayPacket, emission: &mut Emission) {
        intersect_sun(simd, self, rays, emission);
    }
}

#[inline(always)]
fn sample_sun_body(light: &SunLight, start: &Lanes3, u: &[Lanes; 2], samples: &mut LightSamples) {
    let axis = light.to_light.to_array();
    let pdf = 1.0 / (2.0 * PI * light.cap);
    for l in 0..LANES {
        let direction = in_cone(axis, light.cap, [u[0][l], u[1][l]]);
        for axis in 0..3 {
            samples.rays.origin[axis][l] = start[axis][l];
            samples.rays.direction[axis][l] = direction[axis];
            samples.radiance[axis][l] = light.radiance[axis];
        }
        samples.rays.t_min[l] = 0.0;
        samples.rays.t_max[l] = f32::INFINITY;
        samples.pdf[l] = pdf;
    }
}

lane_kernel! {
    fn sample_sun(
        light: &SunLight,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) = sample_sun_body;
}

#[inline(always)]
fn intersect_sun_body(light: &SunLight, rays: &RayPacket, emission: &mut Emission) {
    let mut lanes = 0;
    for l in 0..LANES {
        // Compare the chord to the centre, whose square is twice 1 minus the cosine
        let mut chord2 = 0.0;
        for axis in 0..3 {
            let difference = rays.direction[axis][l] - light.to_light[axis];
            chord2 += difference * difference;
        }
        lanes |= u32::from(chord2 < 2.0 * light.cap) << l;
        emission.t[l] = f32::INFINITY;
        emission.pdf[l] = 1.0 / (2.0 * PI * light.cap);
    }
    emission.radiance = light.radiance;
    emission.lanes = lanes;
}

lane_kernel! {
    fn intersect_sun(light: &SunLight, rays: &RayPacket, emission: &mut Emission) = intersect_sun_body;
}
