//! The surface area heuristic (MacDonald & Booth 1990) with the costs of this traversal.
//!
//! One SIMD operation tests a block, however many of its lanes are in use, and costs about as much as the test of an
//! 8-wide node: that is the unit of cost. So a set of `n` references costs `ceil(n / 16)` blocks times the area of
//! its box. As a side effect, low splits prefer full blocks.

use super::reference::Bounds;
use crate::blocks::BLOCK_SIZE;

/// Cost of one more binary node: a full wide node replaces seven of them, an average one five.
pub(super) const INNER_NODE: f64 = 0.2;

/// Number of blocks for `count` references.
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

/// Expected cost of two sets of references.
#[inline(always)]
pub(super) fn of_pair(boxes: [Bounds; 2], counts: [usize; 2]) -> f64 {
    of_set(boxes[0].area(), counts[0]) + of_set(boxes[1].area(), counts[1])
}
