//! Regions of space that clips keep.

use glam::DVec3;

/// A region in world coordinates. Particles belong to it by their centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// Points on the side of a plane that its normal points away from, and on the plane.
    HalfSpace {
        /// A point on the plane.
        point: DVec3,
        /// The normal, not zero.
        normal: DVec3,
    },
    /// Points in a box and on its faces.
    Box {
        /// Lower corner.
        min: DVec3,
        /// Upper corner.
        max: DVec3,
    },
    /// Points outside of a box.
    OutsideBox {
        /// Lower corner.
        min: DVec3,
        /// Upper corner.
        max: DVec3,
    },
    /// Points between two planes that are normal to an axis, and on them.
    Slab {
        /// The axis, 0 to 2.
        axis: usize,
        /// Lowest coordinate.
        low: f64,
        /// Highest coordinate.
        high: f64,
    },
}

impl Region {
    /// Whether `point` is in the region; one that contains NaN is not.
    pub fn contains(&self, point: DVec3) -> bool {
        let is_in = |min: DVec3, max: DVec3| point.cmpge(min).all() && point.cmple(max).all();
        match *self {
            Self::HalfSpace { point: on, normal } => (point - on).dot(normal) <= 0.0,
            Self::Box { min, max } => is_in(min, max),
            Self::OutsideBox { min, max } => !point.is_nan() && !is_in(min, max),
            Self::Slab { axis, low, high } => (low..=high).contains(&point[axis]),
        }
    }

    /// The planes that bound the region: a point on each, and its unit normal, which points away from the region. None
    /// if the region is not convex.
    pub fn planes(&self) -> Option<Vec<(DVec3, DVec3)>> {
        let faces = |axis: usize, min: DVec3, max: DVec3| {
            let normal = DVec3::AXES[axis];
            [(min, -normal), (max, normal)]
        };
        match *self {
            Self::HalfSpace { point, normal } => Some(vec![(point, normal)]),
            Self::Box { min, max } => Some((0..3).flat_map(|axis| faces(axis, min, max)).collect()),
            Self::Slab { axis, low, high } => {
                Some(faces(axis, DVec3::splat(low), DVec3::splat(high)).to_vec())
            }
            Self::OutsideBox { .. } => None,
        }
    }
}
