//! A light at infinite distance with an angular size: directions in a cone, uniform in solid angle.

#![expect(clippy::needless_range_loop, reason = "loops over axes, several arrays at a time")]

use std::f32::consts::PI;

use glam::Vec3;

use super::lanes::{LightExtent, LightHit, LightSample, SampledLight};
use super::light::{Beam, PhotonSource};
use crate::render::shading::in_cone;

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

impl SunLight {
    /// 1 minus the cosine of half the apparent diameter.
    pub(super) const fn cap(&self) -> f32 {
        self.cap
    }
}

impl SampledLight for SunLight {
    #[inline(always)]
    fn sampled(&self, _point: [f32; 3], u: [f32; 2]) -> LightSample {
        LightSample {
            direction: in_cone(self.to_light.to_array(), self.cap, u),
            distance: f32::INFINITY,
            radiance: self.radiance,
            pdf: 1.0 / (2.0 * PI * self.cap),
        }
    }
}

impl LightExtent for SunLight {
    fn photon_source(&self) -> PhotonSource {
        PhotonSource::Distant(Beam {
            to_light: self.to_light,
            cap: self.cap,
            irradiance: self.irradiance,
        })
    }

    fn is_visible(&self) -> bool {
        self.is_visible
    }

    #[inline(always)]
    fn radiance(&self) -> Vec3 {
        self.radiance
    }

    #[inline(always)]
    fn hit(&self, _origin: [f32; 3], direction: [f32; 3]) -> LightHit {
        // Compare the chord to the centre, whose square is twice 1 minus the cosine
        let mut chord2 = 0.0;
        for axis in 0..3 {
            let difference = direction[axis] - self.to_light[axis];
            chord2 += difference * difference;
        }
        LightHit {
            is_hit: chord2 < 2.0 * self.cap,
            t: f32::INFINITY,
            pdf: 1.0 / (2.0 * PI * self.cap),
        }
    }
}
