//! Flat lights that emit the same radiance in all directions of one side: rectangles, sampled uniformly in the solid
//! angle that they cover (Ureña, Fajardo and King, "An area-preserving parametrization for spherical rectangles",
//! 2013), and discs, sampled uniformly in area. Small rectangles are sampled in area as well, where the solid angle
//! would be inexact and the difference is small.

#![expect(clippy::needless_range_loop, reason = "loops over axes, several arrays at a time")]

use std::f32::consts::PI;

use glam::Vec3;

use super::lanes::{LightExtent, LightHit, LightSample, SampledLight};
use super::light::PhotonSource;
use crate::render::shading::disc;
use spherule_tree::math::functions::{acos, sin_cos};

/// Solid angle in steradians from which a rectangle is sampled in it.
const MIN_SOLID_ANGLE: f32 = 0.05;

/// Outlines of flat lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outline {
    Rectangle,
    Ellipse,
}

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct PanelLight {
    pub(super) outline: Outline,
    pub(super) center: Vec3,
    /// Unit vectors along the width and the height, and in the direction that the light shines.
    pub(super) axes: [Vec3; 3],
    /// Half the width and half the height.
    pub(super) half: [f32; 2],
    pub(super) radiance: Vec3,
    pub(super) is_visible: bool,
}

impl PanelLight {
    #[inline(always)]
    fn area(&self) -> f32 {
        match self.outline {
            Outline::Rectangle => 4.0 * self.half[0] * self.half[1],
            Outline::Ellipse => PI * self.half[0] * self.half[1],
        }
    }

    /// The vector from `point` to the centre in the axes of the light.
    #[inline(always)]
    fn center_from(&self, point: [f32; 3]) -> [f32; 3] {
        let mut own = [0.0; 3];
        for (own, along) in own.iter_mut().zip(&self.axes) {
            for axis in 0..3 {
                *own += along[axis] * (self.center[axis] - point[axis]);
            }
        }
        own
    }
}

/// A rectangle in the plane `z` as seen from the origin.
#[derive(Clone, Copy)]
struct SphericalRectangle {
    x: [f32; 2],
    y: [f32; 2],
    /// Negative.
    z: f32,
    b0: f32,
    b1: f32,
    k: f32,
    solid_angle: f32,
}

impl SphericalRectangle {
    #[inline(always)]
    fn new(center: [f32; 3], half: [f32; 2]) -> Self {
        let x = [center[0] - half[0], center[0] + half[0]];
        let y = [center[1] - half[1], center[1] + half[1]];
        let z = -center[2].abs();
        // The z components of the normals of the planes through the origin and the edges
        let normal = |a: f32| a / (z * z + a * a).sqrt();
        let n = [-normal(y[0]), normal(x[1]), normal(y[1]), -normal(x[0])];
        // The inner angles
        let g = |a: f32, b: f32| acos(bounded(-a * b));
        let [g2, g3] = [g(n[2], n[3]), g(n[3], n[0])];
        let k = 2.0 * PI - g2 - g3;
        Self { x, y, z, b0: n[0], b1: n[2], k, solid_angle: g(n[0], n[1]) + g(n[1], n[2]) - k }
    }

    /// The point at `u`, uniform in solid angle.
    #[inline(always)]
    fn point(&self, u: [f32; 2]) -> [f32; 2] {
        // Find the column that cuts off the part u[0] of the solid angle
        let (sin, cos) = sin_cos(u[0] * self.solid_angle + self.k);
        let f = (cos * self.b0 - self.b1) / sin;
        let c = 1.0 / (f * f + self.b0 * self.b0).sqrt();
        let c = bounded(if f > 0.0 { c } else { -c });
        let rest = 1.0 - c * c;
        let x = -c * self.z / (if rest > 1e-12 { rest } else { 1e-12 }).sqrt();
        let x = between(x, self.x);
        // Find the point in the column
        let d2 = x * x + self.z * self.z;
        let height = |y: f32| y / (d2 + y * y).sqrt();
        let (h0, h1) = (height(self.y[0]), height(self.y[1]));
        let h = h0 + u[1] * (h1 - h0);
        let rest = 1.0 - h * h;
        let y = h * (d2 / (if rest > 1e-12 { rest } else { 1e-12 })).sqrt();
        [x, between(y, self.y)]
    }
}

#[inline(always)]
fn bounded(value: f32) -> f32 {
    between(value, [-1.0, 1.0])
}

#[inline(always)]
fn between(value: f32, [low, high]: [f32; 2]) -> f32 {
    let value = if value > low { value } else { low };
    if value < high { value } else { high }
}

/// Probability density, per steradian, of a point that is sampled uniformly on the area of the light. `distance2` is
/// the squared distance of the point, `height` the distance from the plane of the light.
#[inline(always)]
fn pdf_of_area(distance2: f32, height: f32, area: f32) -> f32 {
    distance2 * distance2.sqrt() / (height * area)
}

impl SampledLight for PanelLight {
    #[inline(always)]
    fn sampled(&self, point: [f32; 3], u: [f32; 2]) -> LightSample {
        let is_rectangle = self.outline == Outline::Rectangle;
        let center = self.center_from(point);
        // Choose a point in the area, or in the solid angle
        let [a, b] = if is_rectangle { [2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0] } else { disc(u) };
        let mut to_point = [center[0] + a * self.half[0], center[1] + b * self.half[1], center[2]];
        let mut solid_angle = 0.0;
        if is_rectangle {
            let view = SphericalRectangle::new(center, self.half);
            solid_angle = view.solid_angle;
            let [x, y] = view.point(u);
            let is_large = solid_angle >= MIN_SOLID_ANGLE;
            to_point[0] = if is_large { x } else { to_point[0] };
            to_point[1] = if is_large { y } else { to_point[1] };
        }
        // Compute the direction to it
        let mut distance2 = 0.0;
        for axis in 0..3 {
            distance2 += to_point[axis] * to_point[axis];
        }
        let distance = distance2.sqrt();
        let mut direction = [0.0; 3];
        for axis in 0..3 {
            let mut along = 0.0;
            for own in 0..3 {
                along += to_point[own] * self.axes[own][axis];
            }
            direction[axis] = along / distance;
        }
        // Only points in front of the light are lit
        let height = -center[2];
        let is_in_front = height > 0.0;
        let is_large = solid_angle >= MIN_SOLID_ANGLE;
        let of_area = pdf_of_area(distance2, height, self.area());
        let pdf = if is_large { 1.0 / solid_angle } else { of_area };
        LightSample {
            direction,
            distance,
            radiance: if is_in_front { self.radiance } else { Vec3::ZERO },
            pdf: if is_in_front { pdf } else { 1.0 },
        }
    }
}

impl LightExtent for PanelLight {
    fn photon_source(&self) -> PhotonSource {
        PhotonSource::Panel {
            center: self.center,
            axes: self.axes,
            half: self.half,
            is_ellipse: self.outline == Outline::Ellipse,
            area: self.area(),
            radiance: self.radiance,
        }
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
        let is_rectangle = self.outline == Outline::Rectangle;
        // Intersect the ray with the plane of the light
        let center = self.center_from(origin);
        let mut along = [0.0; 3];
        for own in 0..3 {
            for axis in 0..3 {
                along[own] += direction[axis] * self.axes[own][axis];
            }
        }
        let t = center[2] / along[2];
        let a = (along[0] * t - center[0]) / self.half[0];
        let b = (along[1] * t - center[1]) / self.half[1];
        // Accept hits in the outline from the front
        let is_within =
            if is_rectangle { a.abs() < 1.0 && b.abs() < 1.0 } else { a * a + b * b < 1.0 };
        let mut pdf = pdf_of_area(t * t, -center[2], self.area());
        if is_rectangle {
            let solid_angle = SphericalRectangle::new(center, self.half).solid_angle;
            pdf = if solid_angle >= MIN_SOLID_ANGLE { 1.0 / solid_angle } else { pdf };
        }
        LightHit { is_hit: is_within && along[2] < 0.0 && t > 0.0, t, pdf }
    }
}
