//! The surface area heuristic (MacDonald & Booth 1990) in units of our traversal.
//!
//! A block is tested by one SIMD operation whether all its lanes are filled or not, and costs about
//! as much as an 8-wide node: that is the unit. So a set of `n` references costs its blocks,
//! `ceil(n / 16)`, times the area of its box, which also makes the lower splits fall where blocks
//! are full.

use super::reference::Bounds;
use spherule_formats::blocks::BLOCK_SIZE;

/// One more binary node: seven of them make a wide node when it is full, five as they usually are.
pub(super) const INNER_NODE: f64 = 0.2;

/// Blocks for `count` references.
#[inline(always)]
fn blocks(count: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53")]
    {
        count.div_ceil(BLOCK_SIZE) as f64
    }
}

/// Expected cost of `count` references in a box of surface `area`.
#[inline(always)]
pub(super) fn of_set(area: f64, count: usize) -> f64 {
    area * blocks(count)
}

/// Expected cost of two sets.
#[inline(always)]
pub(super) fn of_pair(boxes: [Bounds; 2], counts: [usize; 2]) -> f64 {
    of_set(boxes[0].area(), counts[0]) + of_set(boxes[1].area(), counts[1])
}
