//! Axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box; empty when `min > max` on any axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// The empty box.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around `points`.
    #[inline]
    pub fn around(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |b, p| b.extend(*p))
    }

    /// This box, extended to contain `point`.
    #[must_use]
    #[inline]
    pub fn extend(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both boxes.
    #[must_use]
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The intersection of both boxes; empty if they are disjoint.
    #[must_use]
    #[inline]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// This box grown by `length` on every side.
    #[must_use]
    #[inline]
    pub fn padded(self, length: f32) -> Self {
        Self { min: self.min - length, max: self.max + length }
    }

    /// This box with every face moved outwards by one step of f32, so that it contains everything that the
    /// unrounded box would contain.
    #[must_use]
    #[inline]
    pub fn rounded_outwards(self) -> Self {
        Self { min: self.min.map(f32::next_down), max: self.max.map(f32::next_up) }
    }

    /// True if the box is empty.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Edge lengths; zero for the empty box.
    #[inline]
    pub fn size(&self) -> Vec3 {
        (self.max - self.min).max(Vec3::ZERO)
    }

    /// True if `other` lies inside, borders included.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        self.min.cmple(other.min).all() && self.max.cmpge(other.max).all()
    }

    /// Surface area in f64, so that sums over many boxes keep their precision.
    #[inline]
    pub fn area(&self) -> f64 {
        let s = self.size().as_dvec3();
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    }
}
