//! Performs splits in place. The references of a node are at the front of its slice; the rest of the slice is free
//! space for references that later splits add.

use rayon::prelude::*;

use super::budget;
use super::partition::partition;
use super::reference::{Bounds, Parts, Reference};
use super::split::{BinGrid, Split, SplitPosition};
use super::sweep::{self, SWEEP_LEN};
use super::unsplit;
use super::{CHUNK, is_large};

/// A node during the build. The first `count` elements of the slice are its references.
#[derive(Debug)]
pub(super) struct BuildNode<'a> {
    pub(super) storage: &'a mut [Reference],
    pub(super) count: usize,
    pub(super) bounds: Bounds,
}

impl<'a> BuildNode<'a> {
    fn with_bounds((storage, count): (&'a mut [Reference], usize)) -> Self {
        let bounds = bounds_of(&storage[..count]);
        Self { storage, count, bounds }
    }
}

/// Bounding box of `references`.
pub(super) fn bounds_of(references: &[Reference]) -> Bounds {
    if is_large(references.len()) {
        let parts = references.par_chunks(CHUNK).map(Bounds::around);
        parts.reduce(|| Bounds::EMPTY, Bounds::union)
    } else {
        Bounds::around(references)
    }
}

/// Splits a node as described by `split`.
pub(super) fn by_split<'a>(node: BuildNode<'a>, split: &Split, parts: Parts) -> [BuildNode<'a>; 2] {
    // Partition the references
    let references = &mut node.storage[..node.count];
    match split.place {
        SplitPosition::Centers { grid, first_above } => {
            let center_bin = |r: &Reference| grid.bin(r.bounds().doubled_center(), split.axis);
            partition(references, |r| center_bin(r) < first_above);
        }
        SplitPosition::Rank => select_lowest(references, split.axis, split.counts[0]),
        SplitPosition::Plane { grid, first_above } => {
            return by_plane(node, split, grid, first_above, parts);
        }
    }
    // Distribute the free space between the children
    let [below, above] = lay_out(node.storage, split.counts, &[]);
    let [lower, upper] = split.boxes;
    [(below, lower), (above, upper)].map(|((storage, count), bounds)| BuildNode {
        storage,
        count,
        bounds,
    })
}

/// Splits at the median of the longest axis, for sets that no rule can split.
pub(super) fn by_number(node: BuildNode<'_>) -> [BuildNode<'_>; 2] {
    let axis = (node.bounds.max - node.bounds.min).max_position();
    let below = budget::half_in_blocks(node.count);
    select_lowest(&mut node.storage[..node.count], axis, below);
    lay_out(node.storage, [below, node.count - below], &[]).map(BuildNode::with_bounds)
}

/// Moves the `count` references with the lowest centres on `axis` to the front.
fn select_lowest(references: &mut [Reference], axis: usize, count: usize) {
    if references.len() <= SWEEP_LEN {
        return sweep::sort(references, axis);
    }
    // A node holds at most one part of a particle, so no two references compare equal.
    references.select_nth_unstable_by(count, |a, b| {
        let [x, y] = [a, b].map(|r| r.bounds().doubled_center()[axis]);
        x.total_cmp(&y).then(a.particle.cmp(&b.particle))
    });
}

/// Splits a node at the lower plane of bin `first_above`, which may cut references.
fn by_plane<'a>(
    node: BuildNode<'a>,
    split: &Split,
    grid: BinGrid,
    first_above: usize,
    parts: Parts,
) -> [BuildNode<'a>; 2] {
    // Move references that the plane does not cut to the front, those below it first
    let begins_below = |r: &Reference| grid.bin(r.bounds().min, split.axis) < first_above;
    let ends_below = |r: &Reference| grid.bin(r.bounds().max, split.axis) < first_above;
    let references = &mut node.storage[..node.count];
    let sided = partition(references, |r| ends_below(r) || !begins_below(r));
    let (sides, straddlers) = references.split_at_mut(sided);
    let below = partition(sides, ends_below);
    // Cut the others, or assign them to one side
    let plane = grid.plane(split.axis, first_above);
    let (kept, added) = unsplit::divide(straddlers, split, plane, parts);
    // Swap the references that were added below with those above, so that each side is contiguous
    let above = sided - below;
    let mixed = &mut references[below..sided + kept];
    let moved = above.min(kept);
    let (front, back) = mixed.split_at_mut(mixed.len() - moved);
    front[..moved].swap_with_slice(back);
    lay_out(node.storage, [below + kept, above], &added).map(BuildNode::with_bounds)
}

/// Distributes the slice of a node between two children. The references of both are consecutive, `counts` of them;
/// `added` is appended to those of the second child.
fn lay_out<'a>(
    storage: &'a mut [Reference],
    counts: [usize; 2],
    added: &[Reference],
) -> [(&'a mut [Reference], usize); 2] {
    let [below, kept] = counts;
    let above = kept + added.len();
    let start = below + budget::share(storage.len() - below - above, [below, above])[0];
    // The order within a child is arbitrary, so only as many references move as necessary.
    let moved = kept.min(start - below);
    storage.copy_within(below..below + moved, start + kept - moved);
    storage[start + kept..start + above].copy_from_slice(added);
    let (lower, upper) = storage.split_at_mut(start);
    [(lower, below), (upper, above)]
}
