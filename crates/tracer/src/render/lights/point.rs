//! Point lights.

use glam::Vec3;

use super::lanes::{LightSample, SampledLight, sample_lanes};
use super::light::{Light, LightSamples, PhotonSource};
use crate::scene::Falloff;
use spherule_tree::math::{Lanes, Lanes3, Supported};

/// A light without extent.
#[derive(Debug, Clone, Copy)]
pub(super) struct PointLight {
    pub(super) position: Vec3,
    pub(super) falloff: Falloff,
    pub(super) intensity: Vec3,
    pub(super) casts_shadow: bool,
}

impl Light for PointLight {
    fn sample_li(
        &self,
        simd: Supported,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        sample_lanes(simd, self, start, u, samples);
    }

    fn casts_shadow(&self) -> bool {
        self.casts_shadow
    }

    fn photon_source(&self) -> Option<PhotonSource> {
        // Light that does not fall off with distance has no flux that is conserved
        let is_physical = self.falloff == Falloff::InverseSquare;
        (self.casts_shadow && is_physical)
            .then_some(PhotonSource::Point { position: self.position, intensity: self.intensity })
    }
}

impl SampledLight for PointLight {
    /// At the exact position of the light the direction is NaN, so that a material rejects it.
    #[inline(always)]
    fn sampled(&self, point: [f32; 3], _u: [f32; 2]) -> LightSample {
        let mut v = [0.0; 3];
        for axis in 0..3 {
            v[axis] = self.position[axis] - point[axis];
        }
        let distance = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        let inverse = 1.0 / distance;
        let has_falloff = self.falloff == Falloff::InverseSquare;
        let falloff = if has_falloff { 1.0 / (distance * distance) } else { 1.0 };
        LightSample {
            direction: [v[0] * inverse, v[1] * inverse, v[2] * inverse],
            distance,
            radiance: falloff * self.intensity,
            pdf: f32::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spherule_tree::math::{lane3, splat, splat3};

    #[test]
    fn point_light_falloff() {
        let sample = |falloff, start| {
            let light = PointLight {
                position: Vec3::new(1.0, 0.0, 4.0),
                falloff,
                intensity: Vec3::splat(8.0),
                casts_shadow: true,
            };
            let mut samples = LightSamples::default();
            let u = [splat(0.0); 2];
            light.sample_li(Supported::default(), &splat3(start), &u, &mut samples);
            let rays = &samples.rays;
            (lane3(&rays.direction, 3), rays.t_max[3], samples.radiance[2][3])
        };
        let below = Vec3::new(1.0, 0.0, 0.0);
        assert_eq!(sample(Falloff::None, below), (Vec3::Z, 4.0, 8.0));
        assert_eq!(sample(Falloff::InverseSquare, below), (Vec3::Z, 4.0, 0.5));
        let (direction, distance, _) = sample(Falloff::None, Vec3::new(1.0, 0.0, 4.0));
        assert!(direction.is_nan() && distance == 0.0);
    }
}
