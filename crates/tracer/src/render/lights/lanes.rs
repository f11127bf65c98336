//! Lights that are written for one point and one ray, and the loops over the lanes of a packet that all of them share.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use glam::Vec3;

use super::light::{Emission, Light, LightSamples, PhotonSource};
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// A sample of a light at one point; see [`LightSamples`].
pub(super) struct LightSample {
    /// Unit vector towards the light.
    pub(super) direction: [f32; 3],
    /// Distance of the light.
    pub(super) distance: f32,
    pub(super) radiance: Vec3,
    pub(super) pdf: f32,
}

/// A light as seen from one point.
pub(super) trait SampledLight {
    /// Samples the unoccluded light at `point`; `u` is uniform in the unit square.
    fn sampled(&self, point: [f32; 3], u: [f32; 2]) -> LightSample;
}

/// A ray at a light with an extent; see [`Emission`].
pub(super) struct LightHit {
    pub(super) is_hit: bool,
    pub(super) t: f32,
    pub(super) pdf: f32,
}

/// A light that rays can hit.
pub(super) trait LightExtent: SampledLight + Sync {
    /// Its radiance, linear RGB.
    fn radiance(&self) -> Vec3;

    /// Where its photons come from.
    fn photon_source(&self) -> PhotonSource;

    /// Whether the camera sees it.
    fn is_visible(&self) -> bool;

    /// Intersects a ray with it.
    fn hit(&self, origin: [f32; 3], direction: [f32; 3]) -> LightHit;
}

impl<L: LightExtent> Light for L {
    fn sample_li(
        &self,
        simd: Supported,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        sample_lanes(simd, self, start, u, samples);
    }

    fn has_extent(&self) -> bool {
        true
    }

    fn photon_source(&self) -> Option<PhotonSource> {
        Some(LightExtent::photon_source(self))
    }

    fn is_visible(&self) -> bool {
        LightExtent::is_visible(self)
    }

    fn intersect(&self, simd: Supported, rays: &RayPacket, emission: &mut Emission) {
        intersect_lanes(simd, self, rays, emission);
    }
}

#[inline(always)]
fn sample_body<L: SampledLight>(
    light: &L,
    start: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut LightSamples,
) {
    for l in 0..LANES {
        let sample = light.sampled([start[0][l], start[1][l], start[2][l]], [u[0][l], u[1][l]]);
        for axis in 0..3 {
            samples.rays.origin[axis][l] = start[axis][l];
            samples.rays.direction[axis][l] = sample.direction[axis];
            samples.radiance[axis][l] = sample.radiance[axis];
        }
        // The shadow ray ends at the light
        samples.rays.t_min[l] = 0.0;
        samples.rays.t_max[l] = sample.distance;
        samples.pdf[l] = sample.pdf;
    }
}

lane_kernel! {
    /// [`Light::sample_li`](super::Light::sample_li).
    pub(super) fn sample_lanes<L: SampledLight>(
        light: &L,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) = sample_body;
}

#[inline(always)]
fn intersect_body<L: LightExtent>(light: &L, rays: &RayPacket, emission: &mut Emission) {
    let (o, d) = (&rays.origin, &rays.direction);
    let mut lanes = 0;
    for l in 0..LANES {
        let hit = light.hit([o[0][l], o[1][l], o[2][l]], [d[0][l], d[1][l], d[2][l]]);
        lanes |= u32::from(hit.is_hit) << l;
        emission.t[l] = hit.t;
        emission.pdf[l] = hit.pdf;
    }
    emission.radiance = light.radiance();
    emission.lanes = lanes;
}

lane_kernel! {
    /// [`Light::intersect`](super::Light::intersect).
    fn intersect_lanes<L: LightExtent>(light: &L, rays: &RayPacket, emission: &mut Emission) = intersect_body;
}
