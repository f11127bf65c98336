//! Splits: proposed by split rules, and performed by `divide.rs`.

use glam::Vec3A;

use super::reference::{Bounds, Parts, Reference};

/// References of a node to be split.
#[derive(Debug, Clone, Copy)]
pub(super) struct PrimSet<'a> {
    pub(super) references: &'a [Reference],
    /// Bounding box of the references.
    pub(super) bounds: Bounds,
    pub(super) parts: Parts<'a>,
    /// Number of references that a split may add.
    pub(super) free: usize,
}

/// Finds the cheapest split of one kind.
pub(super) trait SplitRule {
    /// None if every split leaves one child empty.
    fn find(&self, set: &PrimSet) -> Option<Split>;
}

/// A proposed split.
#[derive(Debug, Clone, Copy)]
pub(super) struct Split {
    /// Cost by the surface area heuristic, without the test of the node itself.
    pub(super) cost: f64,
    /// Boxes of the two children.
    pub(super) boxes: [Bounds; 2],
    /// Reference counts of the two children.
    pub(super) counts: [usize; 2],
    pub(super) axis: usize,
    pub(super) place: SplitPosition,
}

/// Position of a split on its axis.
#[derive(Debug, Clone, Copy)]
pub(super) enum SplitPosition {
    /// References are separated by the bins of their centres: below bin `first_above`, or from it on.
    Centers { grid: BinGrid, first_above: usize },
    /// The references with the lowest centres go to the first child, as many as its count.
    Rank,
    /// The lower plane of bin `first_above` separates or cuts references.
    Plane { grid: BinGrid, first_above: usize },
}

/// Bins per axis. More bins hardly improve the splits, because splits near the leaves are found exactly.
pub(super) const BINS: usize = 16;

/// A grid of equal bins over a box.
#[derive(Debug, Clone, Copy)]
pub(super) struct BinGrid {
    origin: Vec3A,
    width: Vec3A,
    /// Bins per unit of length.
    scale: Vec3A,
}

impl BinGrid {
    #[expect(clippy::cast_precision_loss, reason = "a small constant")]
    pub(super) fn over(bounds: Bounds) -> Self {
        let width = (bounds.max - bounds.min) * (1.0 / BINS as f32);
        Self { origin: bounds.min, width, scale: width.recip() }
    }

    /// Bin of `point` on each axis; the first bin if the box has no extent on an axis.
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

    /// Bin of `point` on one axis.
    #[inline(always)]
    pub(super) fn bin(&self, point: Vec3A, axis: usize) -> usize {
        self.bins(point)[axis]
    }

    /// Position of the lower plane of a bin.
    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    pub(super) fn plane(&self, axis: usize, bin: usize) -> f32 {
        self.origin[axis] + bin as f32 * self.width[axis]
    }
}
