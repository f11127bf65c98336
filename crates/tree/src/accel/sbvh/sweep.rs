//! Object splits of small sets, by the full sweep of MacDonald & Booth (1990) over all positions. Near the leaves
//! bins are too coarse to fill blocks, and sorting a hundred references is cheap.

use super::cost;
use super::reference::{Bounds, Reference};
use super::split::{PrimSet, Split, SplitPosition, SplitRule};

/// Largest set that is swept.
pub(super) const SWEEP_LEN: usize = 128;

/// The split rule of this module, for sets of up to [`SWEEP_LEN`].
#[derive(Debug, Clone, Copy)]
pub(super) struct SweptObjectSplit;

impl SplitRule for SweptObjectSplit {
    fn find(&self, set: &PrimSet) -> Option<Split> {
        let mut best: Option<Split> = None;
        for axis in 0..3 {
            sweep(set.references, axis, &mut best);
        }
        best
    }
}

/// Indices of references, sorted by centre and then by index: the sort key in the upper half, the index in the lower
/// half.
type Order = [u64; SWEEP_LEN];

const PLACE_BITS: u32 = 32;

fn order(references: &[Reference], axis: usize, order: &mut Order) {
    let order = &mut order[..references.len()];
    for (place, (key, reference)) in order.iter_mut().zip(references).enumerate() {
        let center = reference.bounds().doubled_center()[axis];
        *key = (u64::from(ordered_bits(center)) << PLACE_BITS) | place as u64;
    }
    order.sort_unstable();
}

/// Maps a float to an integer with the same order.
fn ordered_bits(value: f32) -> u32 {
    let bits = value.to_bits();
    let sign = 1 << 31;
    if bits & sign == 0 { bits | sign } else { !bits }
}

fn place(key: u64) -> usize {
    (key & ((1 << PLACE_BITS) - 1)) as usize
}

/// Replaces `best` by the cheapest split on `axis` if that is cheaper.
fn sweep(references: &[Reference], axis: usize, best: &mut Option<Split>) {
    let count = references.len();
    // Sort by centre, and accumulate boxes from above
    let mut keys = [0; SWEEP_LEN];
    order(references, axis, &mut keys);
    let bounds = |at: usize| references[place(keys[at])].bounds();
    let mut above = [Bounds::EMPTY; SWEEP_LEN];
    let mut upper = Bounds::EMPTY;
    for at in (1..count).rev() {
        upper = upper.union(bounds(at));
        above[at] = upper;
    }
    // Evaluate every split, while accumulating boxes from below
    let mut below = Bounds::EMPTY;
    for (at, upper) in above.iter().enumerate().take(count).skip(1) {
        below = below.union(bounds(at - 1));
        let (boxes, counts) = ([below, *upper], [at, count - at]);
        let cost = cost::of_pair(boxes, counts);
        if best.is_none_or(|best| cost < best.cost) {
            *best = Some(Split { cost, boxes, counts, axis, place: SplitPosition::Rank });
        }
    }
}

/// Sorts a small set by centres on `axis`.
pub(super) fn sort(references: &mut [Reference], axis: usize) {
    let mut keys = [0; SWEEP_LEN];
    order(references, axis, &mut keys);
    let mut old = [bytemuck::Zeroable::zeroed(); SWEEP_LEN];
    old[..references.len()].copy_from_slice(references);
    for (reference, key) in references.iter_mut().zip(keys) {
        *reference = old[place(key)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_order_as_numbers() {
        let numbers = [f32::NEG_INFINITY, -2.0, -1e-30, 0.0, 1e-30, 3.0, f32::MAX];
        assert!(numbers.is_sorted_by_key(|n| ordered_bits(*n)));
    }
}
