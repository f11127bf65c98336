//! Splits carried out in place: the references of a node lie at the front of its room, before the
//! space for those that later splits add.

use rayon::prelude::*;

use super::budget;
use super::partition::partition;
use super::reference::{Bounds, Parts, Reference};
use super::split::{BinGrid, Split, SplitPlace};
use super::sweep::{self, SWEEP_LEN};
use super::unsplit;
use super::{CHUNK, is_large};

/// A node in its room: its references are the first `count` there.
#[derive(Debug)]
pub(super) struct Roomed<'a> {
    pub(super) room: &'a mut [Reference],
    pub(super) count: usize,
    pub(super) bounds: Bounds,
}

impl<'a> Roomed<'a> {
    fn measured((room, count): (&'a mut [Reference], usize)) -> Self {
        let bounds = bounds_of(&room[..count]);
        Self {
            room,
            count,
            bounds,
        }
    }
}

/// The box of what `references` are parts of.
pub(super) fn bounds_of(references: &[Reference]) -> Bounds {
    if is_large(references.len()) {
        let parts = references.par_chunks(CHUNK).map(Bounds::around);
        parts.reduce(|| Bounds::EMPTY, Bounds::union)
    } else {
        Bounds::around(references)
    }
}

/// Parts a node as `split` says.
pub(super) fn by_split<'a>(node: Roomed<'a>, split: &Split, parts: Parts) -> [Roomed<'a>; 2] {
    let references = &mut node.room[..node.count];
    match split.place {
        SplitPlace::Centers { grid, first_above } => {
            let center_bin = |r: &Reference| grid.bin(r.bounds().doubled_center(), split.axis);
            partition(references, |r| center_bin(r) < first_above);
        }
        SplitPlace::Rank => rank(references, split.axis, split.counts[0]),
        SplitPlace::Plane { grid, first_above } => {
            return by_plane(node, split, grid, first_above, parts);
        }
    }
    let [below, above] = lay_out(node.room, split.counts, &[]);
    let [lower, upper] = split.boxes;
    [(below, lower), (above, upper)].map(|((room, count), bounds)| Roomed {
        room,
        count,
        bounds,
    })
}

/// Halves by number on the longest axis: for sets that no rule can split.
pub(super) fn by_number(node: Roomed<'_>) -> [Roomed<'_>; 2] {
    let axis = (node.bounds.max - node.bounds.min).max_position();
    let below = budget::half_in_blocks(node.count);
    rank(&mut node.room[..node.count], axis, below);
    lay_out(node.room, [below, node.count - below], &[]).map(Roomed::measured)
}

/// Brings the `count` lowest centres on `axis` to the front.
fn rank(references: &mut [Reference], axis: usize, count: usize) {
    if references.len() <= SWEEP_LEN {
        return sweep::sort(references, axis);
    }
    // A node has at most one part of a particle, so that no two are equal.
    references.select_nth_unstable_by(count, |a, b| {
        let [x, y] = [a, b].map(|r| r.bounds().doubled_center()[axis]);
        x.total_cmp(&y).then(a.particle.cmp(&b.particle))
    });
}

/// Parts a node by the lower plane of bin `first_above`.
fn by_plane<'a>(
    node: Roomed<'a>,
    split: &Split,
    grid: BinGrid,
    first_above: usize,
    parts: Parts,
) -> [Roomed<'a>; 2] {
    let begins_below = |r: &Reference| grid.bin(r.bounds().min, split.axis) < first_above;
    let ends_below = |r: &Reference| grid.bin(r.bounds().max, split.axis) < first_above;
    let references = &mut node.room[..node.count];
    let sided = partition(references, |r| ends_below(r) || !begins_below(r));
    let (sides, straddlers) = references.split_at_mut(sided);
    let below = partition(sides, ends_below);
    let plane = grid.plane(split.axis, first_above);
    let (kept, added) = unsplit::divide(straddlers, split, plane, parts);
    // What was kept below lies after what is above.
    let above = sided - below;
    let mixed = &mut references[below..sided + kept];
    let moved = above.min(kept);
    let (front, back) = mixed.split_at_mut(mixed.len() - moved);
    front[..moved].swap_with_slice(back);
    lay_out(node.room, [below + kept, above], &added).map(Roomed::measured)
}

/// Shares a node's room between two sides of `counts` references, which lie one after the other,
/// and adds `added` to the second one.
fn lay_out<'a>(
    room: &'a mut [Reference],
    counts: [usize; 2],
    added: &[Reference],
) -> [(&'a mut [Reference], usize); 2] {
    let [below, kept] = counts;
    let above = kept + added.len();
    let start = below + budget::share(room.len() - below - above, [below, above])[0];
    // The order on a side means nothing: only as many move as must.
    let moved = kept.min(start - below);
    room.copy_within(below..below + moved, start + kept - moved);
    room[start + kept..start + above].copy_from_slice(added);
    let (lower, upper) = room.split_at_mut(start);
    [(lower, below), (upper, above)]
}
