//! Directional lights.

use glam::Vec3;

use super::light::{Beam, Light, LightSamples, PhotonSource};
use spherule_tree::math::{Lanes, Lanes3, Supported, splat, splat3};

/// A light with parallel rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct DirectionalLight {
    /// Unit vector towards the light.
    pub(super) to_light: Vec3,
    /// On surfaces that face the light.
    pub(super) irradiance: Vec3,
    pub(super) casts_shadow: bool,
}

impl Light for DirectionalLight {
    fn sample_li(
        &self,
        _simd: Supported,
        start: &Lanes3,
        _u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        samples.rays.origin = *start;
        samples.rays.direction = splat3(self.to_light);
        samples.rays.t_min = splat(0.0);
        samples.rays.t_max = splat(f32::INFINITY);
        samples.radiance = splat3(self.irradiance);
        samples.pdf = splat(f32::INFINITY);
    }

    fn casts_shadow(&self) -> bool {
        self.casts_shadow
    }

    fn photon_source(&self) -> Option<PhotonSource> {
        let beam = Beam { to_light: self.to_light, cap: 0.0, irradiance: self.irradiance };
        self.casts_shadow.then_some(PhotonSource::Distant(beam))
    }
}
