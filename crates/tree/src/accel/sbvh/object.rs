//! Binned object splits (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"): references are
//! binned by their centres.

use rayon::prelude::*;

use super::cost;
use super::reference::{Bounds, Reference};
use super::split::{BINS, BinGrid, PrimSet, Split, SplitPosition, SplitRule};
use super::{CHUNK, is_large};

/// The split rule of this module.
#[derive(Debug, Clone, Copy)]
pub(super) struct BinnedObjectSplit;

impl SplitRule for BinnedObjectSplit {
    fn find(&self, set: &PrimSet) -> Option<Split> {
        let grid = BinGrid::over(centers(set.references));
        let bins = Bins::of(set.references, &grid);
        let mut best: Option<Split> = None;
        for axis in 0..3 {
            bins.cheapest(axis, grid, &mut best);
        }
        best
    }
}

/// Bounding box of the doubled centres.
fn centers(references: &[Reference]) -> Bounds {
    let of = |references: &[Reference]| {
        references.iter().fold(Bounds::EMPTY, |b, r| b.extend(r.bounds().doubled_center()))
    };
    if is_large(references.len()) {
        let parts = references.par_chunks(CHUNK).map(of);
        parts.reduce(|| Bounds::EMPTY, Bounds::union)
    } else {
        of(references)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Bounds::EMPTY, count: 0 };

    #[inline(always)]
    fn merged(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), count: self.count + other.count }
    }
}

struct Bins([[Bin; BINS]; 3]);

impl Bins {
    const EMPTY: Self = Self([[Bin::EMPTY; BINS]; 3]);

    /// Minimum, maximum and count do not depend on the order in which chunks are merged.
    fn of(references: &[Reference], grid: &BinGrid) -> Self {
        if is_large(references.len()) {
            let parts = references.par_chunks(CHUNK);
            return parts
                .map(|part| Self::of_part(part, grid))
                .reduce(|| Self::EMPTY, Self::merged);
        }
        Self::of_part(references, grid)
    }

    fn of_part(references: &[Reference], grid: &BinGrid) -> Self {
        let mut bins = Self::EMPTY;
        for reference in references {
            let bounds = reference.bounds();
            let places = grid.bins(bounds.doubled_center());
            for (axis, place) in bins.0.iter_mut().zip(places) {
                axis[place] = axis[place].merged(Bin { bounds, count: 1 });
            }
        }
        bins
    }

    fn merged(mut self, other: Self) -> Self {
        for (own, others) in self.0.iter_mut().zip(&other.0) {
            for (bin, other) in own.iter_mut().zip(others) {
                *bin = bin.merged(*other);
            }
        }
        self
    }

    /// Replaces `best` by the cheapest split on `axis` if that is cheaper.
    fn cheapest(&self, axis: usize, grid: BinGrid, best: &mut Option<Split>) {
        let bins = &self.0[axis];
        // Accumulate bins from above
        let mut above = [Bin::EMPTY; BINS];
        above[BINS - 1] = bins[BINS - 1];
        for bin in (0..BINS - 1).rev() {
            above[bin] = above[bin + 1].merged(bins[bin]);
        }
        // Evaluate the split before each bin, while accumulating bins from below
        let mut below = Bin::EMPTY;
        for first_above in 1..BINS {
            below = below.merged(bins[first_above - 1]);
            let above = above[first_above];
            if below.count == 0 || above.count == 0 {
                continue;
            }
            let (boxes, counts) = ([below.bounds, above.bounds], [below.count, above.count]);
            let cost = cost::of_pair(boxes, counts);
            if best.is_none_or(|best| cost < best.cost) {
                *best = Some(Split {
                    cost,
                    boxes,
                    counts,
                    axis,
                    place: SplitPosition::Centers { grid, first_above },
                });
            }
        }
    }
}
