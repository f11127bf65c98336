//! Spheres that emit the same radiance in all directions, sampled uniformly in the solid angle that they cover.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use std::f32::consts::PI;

use glam::Vec3;

use super::light::{Emission, Light, LightSamples, PhotonSource};
use crate::render::shading::in_cone;
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphereLight {
    pub(super) center: Vec3,
    pub(super) radius: f32,
    pub(super) radiance: Vec3,
    pub(super) is_visible: bool,
}

impl Light for SphereLight {
    fn sample_li(
        &self,
        simd: Supported,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        sample_sphere(simd, self, start, u, samples);
    }

    fn has_extent(&self) -> bool {
        true
    }

    fn photon_source(&self) -> Option<PhotonSource> {
        Some(PhotonSource::Sphere {
            center: self.center,
            radius: self.radius,
            radiance: self.radiance,
        })
    }

    fn is_visible(&self) -> bool {
        self.is_visible
    }

    fn intersect(&self, simd: Supported, rays: &RayPacket, emission: &mut Emission) {
        intersect_sphere(simd, self, rays, emission);
    }
}

/// The sphere as seen from a point at `to_center` from its centre.
#[derive(Clone, Copy)]
struct View {
    /// Unit vector towards the centre.
    axis: [f32; 3],
    distance2: f32,
    /// 1 minus the cosine of half the apparent diameter; 2, which is all directions, inside the sphere.
    cap: f32,
}

impl View {
    #[inline(always)]
    fn new(to_center: [f32; 3], radius: f32) -> Self {
        let mut distance2 = 0.0;
        for axis in 0..3 {
            distance2 += to_center[axis] * to_center[axis];
        }
        let inverse = 1.0 / distance2.sqrt();
        let has_axis = inverse > 0.0 && inverse < f32::INFINITY;
        let mut direction = [0.0; 3];
        for axis in 0..3 {
            direction[axis] = to_center[axis] * inverse;
        }
        // Without cancellation for small spheres
        let sin2 = radius * radius / distance2;
        let is_outside = sin2 < 1.0;
        let cosine = (if is_outside { 1.0 - sin2 } else { 0.0 }).sqrt();
        Self {
            axis: if has_axis { direction } else { [0.0, 0.0, 1.0] },
            distance2,
            cap: if is_outside { sin2 / (1.0 + cosine) } else { 2.0 },
        }
    }

    /// Probability density of a direction towards the sphere.
    #[inline(always)]
    fn pdf(&self) -> f32 {
        1.0 / (2.0 * PI * self.cap)
    }

    /// Distance to the sphere along a unit direction at `cosine` to the axis: to its near side from outside, to its far
    /// side from inside.
    #[inline(always)]
    fn distance(&self, cosine: f32, radius: f32) -> f32 {
        let middle = self.distance2.sqrt() * cosine;
        let half2 = radius * radius - self.distance2 + middle * middle;
        let half = (if half2 > 0.0 { half2 } else { 0.0 }).sqrt();
        if self.cap < 2.0 { middle - half } else { middle + half }
    }
}

#[inline(always)]
fn sample_sphere_body(
    light: &SphereLight,
    start: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut LightSamples,
) {
    for l in 0..LANES {
        // Find the cone in which the sphere is seen
        let mut to_center = [0.0; 3];
        for axis in 0..3 {
            to_center[axis] = light.center[axis] - start[axis][l];
        }
        let view = View::new(to_center, light.radius);
        // Sample a direction in this cone
        let direction = in_cone(view.axis, view.cap, [u[0][l], u[1][l]]);
        let mut cosine = 0.0;
        for axis in 0..3 {
            cosine += direction[axis] * view.axis[axis];
            samples.rays.origin[axis][l] = start[axis][l];
            samples.rays.direction[axis][l] = direction[axis];
            samples.radiance[axis][l] = light.radiance[axis];
        }
        // End the shadow ray at the sphere
        samples.rays.t_min[l] = 0.0;
        samples.rays.t_max[l] = view.distance(cosine, light.radius);
        samples.pdf[l] = view.pdf();
    }
}

lane_kernel! {
    fn sample_sphere(
        light: &SphereLight,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) = sample_sphere_body;
}

#[inline(always)]
fn intersect_sphere_body(light: &SphereLight, rays: &RayPacket, emission: &mut Emission) {
    let mut lanes = 0;
    for l in 0..LANES {
        let mut to_center = [0.0; 3];
        let mut cosine = 0.0;
        for axis in 0..3 {
            to_center[axis] = light.center[axis] - rays.origin[axis][l];
        }
        let view = View::new(to_center, light.radius);
        // Compare the chord to the axis, whose square is twice 1 minus the cosine
        let mut chord2 = 0.0;
        for axis in 0..3 {
            let difference = rays.direction[axis][l] - view.axis[axis];
            chord2 += difference * difference;
            cosine += rays.direction[axis][l] * view.axis[axis];
        }
        let is_hit = chord2 < 2.0 * view.cap;
        lanes |= u32::from(is_hit) << l;
        emission.t[l] = view.distance(cosine, light.radius);
        emission.pdf[l] = view.pdf();
    }
    emission.radiance = light.radiance;
    emission.lanes = lanes;
}

lane_kernel! {
    fn intersect_sphere(
        light: &SphereLight,
        rays: &RayPacket,
        emission: &mut Emission,
    ) = intersect_sphere_body;
}
