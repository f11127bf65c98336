//! Splits: what the rules propose and the builder carries out.

use glam::Vec3A;

use super::reference::{Bounds, Parts, Reference};

/// References of a node that is to be split.
#[derive(Debug, Clone, Copy)]
pub(super) struct Set<'a> {
    pub(super) references: &'a [Reference],
    /// Box of all of them.
    pub(super) bounds: Bounds,
    pub(super) parts: Parts<'a>,
    /// References that a split may add.
    pub(super) free: usize,
}

/// A way to find the cheapest split of its kind.
pub(super) trait SplitRule {
    /// None if there is no split with two sides.
    fn find(&self, set: &Set) -> Option<Split>;
}

/// A proposed split.
#[derive(Debug, Clone, Copy)]
pub(super) struct Split {
    /// By the surface area heuristic, the node's own test left out.
    pub(super) cost: f64,
    /// Boxes of the two sides.
    pub(super) boxes: [Bounds; 2],
    /// References of the two sides.
    pub(super) counts: [usize; 2],
    pub(super) axis: usize,
    pub(super) place: SplitPlace,
}

/// Where a split is on its axis.
#[derive(Debug, Clone, Copy)]
pub(super) enum SplitPlace {
    /// References go by the bin of their centre: below bin `first_above`, or from it on.
    Centers { grid: BinGrid, first_above: usize },
    /// The lowest centres go to one side, as many as its count says.
    Rank,
    /// References are cut by the lower plane of bin `first_above`.
    Plane { grid: BinGrid, first_above: usize },
}

/// Bins on each axis. More find hardly better splits: those near the leaves are found exactly.
pub(super) const BINS: usize = 16;

/// Equal bins over a box.
#[derive(Debug, Clone, Copy)]
pub(super) struct BinGrid {
    origin: Vec3A,
    width: Vec3A,
    /// Bins in a unit of length.
    scale: Vec3A,
}

impl BinGrid {
    #[expect(clippy::cast_precision_loss, reason = "a small constant")]
    pub(super) fn over(bounds: Bounds) -> Self {
        let width = (bounds.max - bounds.min) * (1.0 / BINS as f32);
        Self {
            origin: bounds.min,
            width,
            scale: width.recip(),
        }
    }

    /// Bin of `point` on each axis; the first one on an axis without extent.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped, and NaN becomes 0"
    )]
    pub(super) fn bins(&self, point: Vec3A) -> [usize; 3] {
        let places = (point - self.origin) * self.scale;
        let bin = |place: f32| (place as i32).clamp(0, BINS as i32 - 1) as usize;
        [bin(places.x), bin(places.y), bin(places.z)]
    }

    /// Bin on one axis.
    #[inline(always)]
    pub(super) fn bin(&self, point: Vec3A, axis: usize) -> usize {
        self.bins(point)[axis]
    }

    /// Lower plane of a bin.
    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    pub(super) fn plane(&self, axis: usize, bin: usize) -> f32 {
        self.origin[axis] + bin as f32 * self.width[axis]
    }
}
