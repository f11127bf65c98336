//! The interface between lights and integrators.

use glam::Vec3;

use crate::render::shading::in_cone;
use spherule_tree::math::{Lanes, Lanes3, Supported, splat};
use spherule_tree::ray::RayPacket;

/// A light.
pub(in crate::render) trait Light: Sync {
    /// Samples the unoccluded light at `start`, the shading points of a packet. The numbers `u` are in 0..1; a light
    /// without extent does not need them.
    fn sample_li(
        &self,
        simd: Supported,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    );

    /// Whether other objects occlude the light. A light without shadows needs no shadow rays.
    fn casts_shadow(&self) -> bool {
        true
    }

    /// Whether rays can hit the light.
    fn has_extent(&self) -> bool {
        false
    }

    /// Where the photons of the light come from. `None` if it emits none: it casts no shadows, or is not physical.
    fn photon_source(&self) -> Option<PhotonSource> {
        None
    }

    /// Whether the camera sees the light.
    fn is_visible(&self) -> bool {
        false
    }

    /// Intersects rays with a light that has an extent.
    fn intersect(&self, simd: Supported, rays: &RayPacket, emission: &mut Emission) {
        let _ = (simd, rays);
        emission.lanes = 0;
    }
}

/// The origin of photons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::render) enum PhotonSource {
    /// Infinitely far away.
    Distant(Beam),
    /// A point, with its radiant intensity, linear RGB.
    Point { position: Vec3, intensity: Vec3 },
    /// The outside of a sphere, with its radiance, linear RGB.
    Sphere { center: Vec3, radius: f32, radiance: Vec3 },
    /// One side of a rectangle or an ellipse.
    Panel {
        center: Vec3,
        /// Unit vectors along the width and the height, and in the direction that the light shines.
        axes: [Vec3; 3],
        /// Half the width and half the height.
        half: [f32; 2],
        is_ellipse: bool,
        area: f32,
        /// Linear RGB.
        radiance: Vec3,
    },
}

/// Light from infinitely far away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::render) struct Beam {
    /// Unit vector towards its centre.
    pub(in crate::render) to_light: Vec3,
    /// 1 minus the cosine of half the apparent diameter.
    pub(in crate::render) cap: f32,
    /// On surfaces that face the light, linear RGB.
    pub(in crate::render) irradiance: Vec3,
}

impl Beam {
    /// A unit vector towards the light; `u` is uniform in the unit square.
    pub(in crate::render) fn direction(&self, u: [f32; 2]) -> Vec3 {
        in_cone(self.to_light.to_array(), self.cap, u).into()
    }

    /// Tangent of half the apparent diameter.
    pub(in crate::render) fn spread(&self) -> f32 {
        (self.cap * (2.0 - self.cap)).sqrt() / (1.0 - self.cap)
    }
}

/// A sample of a light for each shading point of a packet.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(in crate::render) struct LightSamples {
    /// Rays to the light.
    pub(in crate::render) rays: RayPacket,
    /// Radiance that arrives along each ray; after its reflection, the radiance that arrives at the sample of
    /// the image.
    pub(in crate::render) radiance: Lanes3,
    /// Probability density of each direction, per steradian; infinite for lights without extent, whose `radiance` is
    /// the irradiance on a surface that faces them. Only used by path tracing.
    pub(in crate::render) pdf: Lanes,
    /// Lanes that the light reaches.
    pub(in crate::render) lanes: u32,
    /// Whether mist takes nothing of it, as on a shadow catcher.
    pub(in crate::render) ignores_mist: bool,
}

/// The intersections of rays with a light.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(in crate::render) struct Emission {
    /// Distance along each ray; infinite for lights that are infinitely far away.
    pub(in crate::render) t: Lanes,
    /// Probability density with which the light samples the direction of the ray, per steradian.
    pub(in crate::render) pdf: Lanes,
    /// Radiance of the light, linear RGB, the same in all lanes.
    pub(in crate::render) radiance: Vec3,
    /// Lanes of rays that hit the light.
    pub(in crate::render) lanes: u32,
}

impl Default for Emission {
    fn default() -> Self {
        Self { t: splat(0.0), pdf: splat(0.0), radiance: Vec3::ZERO, lanes: 0 }
    }
}
