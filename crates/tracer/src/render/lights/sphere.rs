//! Spheres that emit the same radiance in all directions, sampled uniformly in the solid angle that they cover.

#![expect(clippy::needless_range_loop, reason = "loops over axes, several arrays at a time")]

use std::f32::consts::PI;

use glam::Vec3;

use super::lanes::{LightExtent, LightHit, LightSample, SampledLight};
use super::light::PhotonSource;
use crate::render::shading::in_cone;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphereLight {
    pub(super) center: Vec3,
    pub(super) radius: f32,
    pub(super) radiance: Vec3,
    pub(super) is_visible: bool,
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

impl SphereLight {
    /// The sphere as seen from `point`.
    #[inline(always)]
    fn view(&self, point: [f32; 3]) -> View {
        let mut to_center = [0.0; 3];
        for axis in 0..3 {
            to_center[axis] = self.center[axis] - point[axis];
        }
        View::new(to_center, self.radius)
    }
}

impl SampledLight for SphereLight {
    #[inline(always)]
    fn sampled(&self, point: [f32; 3], u: [f32; 2]) -> LightSample {
        // Sample a direction in the cone in which the sphere is seen
        let view = self.view(point);
        let direction = in_cone(view.axis, view.cap, u);
        let mut cosine = 0.0;
        for axis in 0..3 {
            cosine += direction[axis] * view.axis[axis];
        }
        LightSample {
            direction,
            distance: view.distance(cosine, self.radius),
            radiance: self.radiance,
            pdf: view.pdf(),
        }
    }
}

impl LightExtent for SphereLight {
    fn photon_source(&self) -> PhotonSource {
        PhotonSource::Sphere { center: self.center, radius: self.radius, radiance: self.radiance }
    }

    fn is_visible(&self) -> bool {
        self.is_visible
    }

    #[inline(always)]
    fn radiance(&self) -> Vec3 {
        self.radiance
    }

    #[inline(always)]
    fn hit(&self, origin: [f32; 3], direction: [f32; 3]) -> LightHit {
        // Compare the chord to the axis, whose square is twice 1 minus the cosine
        let view = self.view(origin);
        let (mut chord2, mut cosine) = (0.0, 0.0);
        for axis in 0..3 {
            let difference = direction[axis] - view.axis[axis];
            chord2 += difference * difference;
            cosine += direction[axis] * view.axis[axis];
        }
        LightHit {
            is_hit: chord2 < 2.0 * view.cap,
            t: view.distance(cosine, self.radius),
            pdf: view.pdf(),
        }
    }
}
