//! Spatial splits (Stich, Friedrich & Dietrich 2009, "Spatial splits in bounding volume hierarchies"): a plane cuts
//! the node, and a sphere that crosses the plane is referenced by both children.
//!
//! Chopped binning (section 4.2 of the paper): each reference is cut at the planes of the bins that it spans. Its
//! parts extend the boxes of the bins. It is counted as an entry in its first bin and as an exit in its last one.

use rayon::prelude::*;

use super::cost;
use super::reference::{Bounds, Parts, Reference};
use super::split::{BINS, BinGrid, PrimSet, Split, SplitPosition, SplitRule};
use super::{CHUNK, is_large};

/// The split rule of this module.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpatialSplit;

impl SplitRule for SpatialSplit {
    /// Considers only splits that add at most `set.free` references.
    fn find(&self, set: &PrimSet) -> Option<Split> {
        let grid = BinGrid::over(set.bounds);
        let bins = Bins::of(set.references, set.parts, &Slabs::of(grid));
        let mut best: Option<Split> = None;
        for axis in 0..3 {
            bins.cheapest(axis, grid, set, &mut best);
        }
        best
    }
}

/// The slabs between the planes of a grid.
struct Slabs {
    grid: BinGrid,
    slabs: [[Slab; BINS]; 3],
}

#[derive(Clone, Copy)]
struct Slab {
    from: f32,
    to: f32,
    /// The slab as a box, unbounded on the other axes.
    bounds: Bounds,
}

impl Slabs {
    fn of(grid: BinGrid) -> Self {
        let slab = |axis: usize, bin: usize| {
            let (from, to) = (grid.plane(axis, bin), grid.plane(axis, bin + 1));
            let mut bounds = Bounds::ALL;
            bounds.min[axis] = from;
            bounds.max[axis] = to;
            Slab { from, to, bounds }
        };
        let slabs = std::array::from_fn(|axis| std::array::from_fn(|bin| slab(axis, bin)));
        Self { grid, slabs }
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    /// References that begin here.
    entries: usize,
    /// References that end here.
    exits: usize,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Bounds::EMPTY, entries: 0, exits: 0 };
}

struct Bins([[Bin; BINS]; 3]);

impl Bins {
    const EMPTY: Self = Self([[Bin::EMPTY; BINS]; 3]);

    fn of(references: &[Reference], parts: Parts, slabs: &Slabs) -> Self {
        if is_large(references.len()) {
            let chunks = references.par_chunks(CHUNK);
            return chunks
                .map(|chunk| Self::of_chunk(chunk, parts, slabs))
                .reduce(|| Self::EMPTY, Self::merged);
        }
        Self::of_chunk(references, parts, slabs)
    }

    fn of_chunk(references: &[Reference], parts: Parts, slabs: &Slabs) -> Self {
        let mut bins = Self::EMPTY;
        for reference in references {
            bins.add(reference, parts, slabs);
        }
        bins
    }

    #[inline(always)]
    fn add(&mut self, reference: &Reference, parts: Parts, slabs: &Slabs) {
        // A reference inside a single cell of the grid needs no cuts
        let bounds = reference.bounds();
        let firsts = slabs.grid.bins(bounds.min);
        let lasts = slabs.grid.bins(bounds.max);
        if firsts == lasts {
            for (bins, place) in self.0.iter_mut().zip(firsts) {
                bins[place].entries += 1;
                bins[place].exits += 1;
                bins[place].bounds = bins[place].bounds.union(bounds);
            }
            return;
        }
        // Cut the reference into slabs, axis by axis
        let (mins, maxs) = (bounds.min.to_array(), bounds.max.to_array());
        let clip = parts.sphere(reference.particle).in_slabs(bounds);
        for axis in 0..3 {
            let (first, last) = (firsts[axis], lasts[axis]);
            let bins = &mut self.0[axis];
            bins[first].entries += 1;
            bins[last].exits += 1;
            let reach = clip.reach_beside(axis);
            for (bin, place) in bins[first..=last].iter_mut().zip(first..) {
                let slab = &slabs.slabs[axis][place];
                let from = slab.from.max(mins[axis]);
                let to = slab.to.min(maxs[axis]);
                let part = clip.slab(axis, reach, from, to);
                bin.bounds = bin.bounds.union(part.intersection(slab.bounds));
            }
        }
    }

    fn merged(mut self, other: Self) -> Self {
        for (own, others) in self.0.iter_mut().zip(&other.0) {
            for (bin, other) in own.iter_mut().zip(others) {
                bin.bounds = bin.bounds.union(other.bounds);
                bin.entries += other.entries;
                bin.exits += other.exits;
            }
        }
        self
    }

    /// Replaces `best` by the cheapest split on `axis` if that is cheaper.
    fn cheapest(&self, axis: usize, grid: BinGrid, set: &PrimSet, best: &mut Option<Split>) {
        let bins = &self.0[axis];
        let count = set.references.len();
        // Accumulate boxes from above
        let mut above = [Bounds::EMPTY; BINS];
        above[BINS - 1] = bins[BINS - 1].bounds;
        for bin in (0..BINS - 1).rev() {
            above[bin] = above[bin + 1].union(bins[bin].bounds);
        }
        // Evaluate the split before each bin, while accumulating bins from below
        let (mut below, mut entered, mut left) = (Bounds::EMPTY, 0, 0);
        for first_above in 1..BINS {
            let bin = &bins[first_above - 1];
            below = below.union(bin.bounds);
            entered += bin.entries;
            left += bin.exits;
            let counts = [entered, count - left];
            // Skip splits with an empty child or one as large as the node, and those above the budget.
            if counts.contains(&0) || counts.contains(&count) || entered - left > set.free {
                continue;
            }
            let boxes = [below, above[first_above]];
            let cost = cost::of_pair(boxes, counts);
            if best.is_none_or(|best| cost < best.cost) {
                *best = Some(Split {
                    cost,
                    boxes,
                    counts,
                    axis,
                    place: SplitPosition::Plane { grid, first_above },
                });
            }
        }
    }
}
