//! Rays: where, which way, how far.

use glam::Vec3;

/// A half-open piece of a line. Lengths are scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start, relative to the sequence's origin.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Nearest distance that counts.
    pub t_min: f32,
    /// Farthest distance that counts.
    pub t_max: f32,
}

impl Ray {
    /// A ray from `origin` along the unit vector `direction` without an end.
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    /// The point at distance `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}
