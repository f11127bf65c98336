//! The upper cuts, as far as a sample determines them: the axis, and a bracket of keys that contains the median.
//!
//! The rank of a value in a sample of m particles gives its rank among all particles within a few times sqrt(m)/2 (as
//! in the selection of Floyd & Rivest 1975). One comparison decides every particle outside of the bracket.

use glam::Vec3;
use rayon::prelude::*;

use super::item::{KeyedParticle, widest};
use super::middle_of;
use crate::order::index_u32;

/// Particles in a cell that `cell.rs` cuts; both of its buffers fit into an L2 cache.
pub const CELL_LEN: usize = 32 * 1024;
/// Largest depth of the cuts: the leaves are numbered in 16 bits.
const MAX_DEPTH: u32 = 15;
/// One particle out of this many is in the sample.
const STRIDE: usize = 12;
/// Largest number of sampled particles that a median is selected from.
const SELECT_LEN: usize = 256 * 1024;
/// Largest number of sampled particles that an axis is chosen from.
const AXIS_LEN: usize = 512;
/// Half the width of a bracket, standard deviations of the rank. The value leaves room for the cuts above, whose
/// places are estimates too: with 3.5, builds over 10^7 particles took several passes, with 4.5 a single one.
const DEVIATIONS: f64 = 4.5;
/// Below this length, a parallel task costs more than it saves.
const PARALLEL_LEN: usize = 4096;

/// The possible keys of a median: particles with keys from `low` up to `low + width` (exclusive) are undecided.
#[derive(Debug, Clone, Copy)]
pub(super) struct MedianBracket {
    low: i64,
    width: u64,
    axis: u32,
}

/// The side of a cut that a particle is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// The particle is in the cell with this index.
    Cell(usize),
    /// The particle is undecided at the cut with this index.
    Undecided(usize),
}

impl MedianBracket {
    /// No cut: all particles are low.
    const NONE: Self = Self { low: i64::MAX, width: 0, axis: 0 };

    /// A bracket that contains all keys.
    fn everything(axis: u32) -> Self {
        Self::between(i64::MIN, i64::MAX, axis)
    }

    /// A bracket that contains the keys from `low` up to `high` (exclusive).
    pub(super) fn between(low: i64, high: i64, axis: u32) -> Self {
        Self { low, width: high.wrapping_sub(low).cast_unsigned(), axis }
    }

    /// Whether there is a cut.
    pub(super) fn is_cut(&self) -> bool {
        self.width > 0
    }

    pub(super) fn axis(&self) -> usize {
        self.axis as usize
    }
}

/// Follows the cuts in `brackets`, a complete binary tree in preorder, until a cut is undecided. `keys` are the
/// keys of the particle along each axis.
#[inline(always)]
pub(super) fn descend(brackets: &[MedianBracket], keys: [i64; 4]) -> Side {
    let (mut cut, mut cell) = (0, 0);
    let mut half = brackets.len().div_ceil(2);
    while half > 0 {
        let bracket = &brackets[cut];
        let key = keys[(bracket.axis & 3) as usize];
        if key.wrapping_sub(bracket.low).cast_unsigned() < bracket.width {
            return Side::Undecided(cut);
        }
        let is_high = key >= bracket.low;
        // A shift, because a condition would become a branch that is mispredicted every other time. `half` is
        // under 2^15, so that the shift leaves all of it or nothing.
        cut += 1 + ((half - 1) >> (usize::from(!is_high) << 4));
        cell = 2 * cell + usize::from(is_high);
        half >>= 1;
    }
    Side::Cell(cell)
}

/// The upper cuts: a complete binary tree in preorder, with empty cuts where cells are small enough already.
#[derive(Debug)]
pub(super) struct CutPlan {
    pub(super) brackets: Vec<MedianBracket>,
    /// The number of particles below each cut.
    pub(super) middles: Vec<usize>,
    /// Bytes that were needed to find the cuts.
    pub(super) bytes: usize,
}

impl CutPlan {
    pub(super) fn from_sample(centers: &[Vec3]) -> Self {
        // Enlarge the cells until 16 bits can number them
        let mut cell_len = CELL_LEN;
        while depth_of(centers.len(), cell_len) > MAX_DEPTH {
            cell_len *= 2;
        }
        let cuts = (1 << depth_of(centers.len(), cell_len)) - 1;
        let mut plan =
            Self { brackets: vec![MedianBracket::NONE; cuts], middles: vec![0; cuts], bytes: 0 };
        // Bracket the medians by a sample
        if cuts > 0 {
            let mut sample = sample_of(centers);
            let mut spare = vec![KeyedParticle::default(); sample.len()];
            plan.bytes = 2 * size_of_val(&sample[..]);
            let subtree = BracketSubtree {
                brackets: &mut plan.brackets,
                middles: &mut plan.middles,
                cell_len,
            };
            subtree.fill(centers.len(), &mut sample, &mut spare);
        }
        plan
    }

    /// Widens the brackets of these cuts, whose medians are outside, to all keys.
    pub(super) fn widen(&mut self, cuts: &[usize]) {
        for cut in cuts {
            let bracket = &mut self.brackets[*cut];
            *bracket = MedianBracket::everything(bracket.axis);
        }
    }
}

/// The depth of the cuts that leaves cells of at most `cell_len` particles.
fn depth_of(len: usize, cell_len: usize) -> u32 {
    if len <= cell_len {
        return 0;
    }
    let middle = middle_of(len);
    1 + depth_of(middle, cell_len).max(depth_of(len - middle, cell_len))
}

/// One particle of each run, at a pseudo-random place in the run, because files are often ordered.
fn sample_of(centers: &[Vec3]) -> Vec<KeyedParticle> {
    (0..centers.len() / STRIDE)
        .into_par_iter()
        .with_min_len(PARALLEL_LEN)
        .map(|run| {
            let hash = (run as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
            let index = run * STRIDE + hash as usize % STRIDE;
            KeyedParticle::new(centers[index], index_u32(index))
        })
        .collect()
}

/// A cut and all cuts below it.
struct BracketSubtree<'a> {
    brackets: &'a mut [MedianBracket],
    middles: &'a mut [usize],
    cell_len: usize,
}

impl BracketSubtree<'_> {
    /// Finds the brackets for `len` particles from `sample`.
    fn fill(self, len: usize, sample: &mut [KeyedParticle], spare: &mut [KeyedParticle]) {
        if len <= self.cell_len {
            return;
        }
        let [bracket, brackets @ ..] = self.brackets else {
            return;
        };
        let [own_middle, middles @ ..] = self.middles else {
            return;
        };
        // Bracket the median along the widest axis
        let middle = middle_of(len);
        *own_middle = middle;
        let axis = widest_axis(sample);
        let guess;
        (*bracket, guess) = bracket_for(sample, axis, middle as f64 / len as f64);
        let low_count = part(sample, spare, axis, guess);

        // Continue on both sides of the estimated median
        let (sample_low, sample_high) = sample.split_at_mut(low_count);
        let (spare_low, spare_high) = spare.split_at_mut(low_count);
        let half = brackets.len() / 2;
        let (brackets_low, brackets_high) = brackets.split_at_mut(half);
        let (middles_low, middles_high) = middles.split_at_mut(half);
        let cell_len = self.cell_len;
        let low = BracketSubtree { brackets: brackets_low, middles: middles_low, cell_len };
        let high = BracketSubtree { brackets: brackets_high, middles: middles_high, cell_len };
        rayon::join(
            || low.fill(middle, spare_low, sample_low),
            || high.fill(len - middle, spare_high, sample_high),
        );
    }
}

/// The axis with the largest extent of the bulk of the particles; a few outliers do not affect it.
fn widest_axis(sample: &[KeyedParticle]) -> usize {
    let stride = sample.len().div_ceil(AXIS_LEN).max(1);
    let points: Vec<Vec3> = sample.iter().step_by(stride).map(KeyedParticle::center).collect();
    let Some(last) = points.len().checked_sub(1) else {
        return 0;
    };
    let trimmed = points.len() / 64;
    let extent = [0, 1, 2].map(|axis| {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values[last - trimmed] - values[trimmed]
    });
    widest(extent.into())
}

/// The bracket of the particle with `fraction` of all particles below it, and the best estimate of its key.
fn bracket_for(sample: &[KeyedParticle], axis: usize, fraction: f64) -> (MedianBracket, i64) {
    let axis_number = index_u32(axis);
    // Select from a limited number of keys
    let stride = sample.len().div_ceil(SELECT_LEN).max(1);
    let mut keys: Vec<i64> = sample.iter().step_by(stride).map(|i| i.key(axis)).collect();
    // Compute the rank and its uncertainty
    let count = keys.len() as f64;
    let deviation = (count * fraction * (1.0 - fraction)).sqrt();
    #[expect(clippy::cast_possible_truncation, reason = "under the length of the sample")]
    let [rank, spread] = [count * fraction, 1.0 + DEVIATIONS * deviation].map(|r| r as usize);
    if rank >= keys.len() {
        return (MedianBracket::everything(axis_number), i64::MAX);
    }
    // Select the estimate and the ends of the bracket
    let (below, guess, above) = keys.select_nth_unstable(rank);
    let low = match rank.checked_sub(spread) {
        Some(rank) => *below.select_nth_unstable(rank).1,
        None => i64::MIN,
    };
    let high = if spread < above.len() { *above.select_nth_unstable(spread).1 } else { i64::MAX };
    (MedianBracket::between(low, high, axis_number), *guess)
}

/// Moves the items below `pivot` to the front of `to` and the others to its end. Returns the number of items in
/// front.
fn part(items: &[KeyedParticle], to: &mut [KeyedParticle], axis: usize, pivot: i64) -> usize {
    let (mut low, mut high) = (0, items.len());
    for item in items {
        let is_low = item.key(axis) < pivot;
        high -= usize::from(!is_low);
        to[if is_low { low } else { high }] = *item;
        low += usize::from(is_low);
    }
    low
}
