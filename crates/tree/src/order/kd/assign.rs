//! Makes the upper cuts exact: one pass over all particles decides most of them, and the rest is decided afterwards.

use std::sync::atomic::{AtomicU16, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::item::{KeyedParticle, key};
use super::plan::{CutPlan, MedianBracket, Side, descend};
use crate::order::index_u32;

/// Smallest number of particles in a task.
const TASK_LEN: usize = 16 * 1024;
/// Smallest number of undecided particles in a task.
const UNDECIDED_TASK_LEN: usize = 2048;

/// The cell of each particle.
#[derive(Debug)]
pub(super) struct CellAssignment {
    /// The cell of each particle; empty if there is only one cell.
    cells: Vec<AtomicU16>,
    pub(super) cell_count: usize,
    /// Peak bytes held beside the particles, here and for the plan.
    pub(super) bytes: u64,
}

impl CellAssignment {
    /// The cell of the particle with this index.
    #[inline(always)]
    pub(super) fn cell(&self, index: usize) -> usize {
        self.cells.get(index).map_or(0, |cell| usize::from(cell.load(Ordering::Relaxed)))
    }
}

/// Assigns all of `centers` to the cells of `plan`.
pub(super) fn assign(centers: &[Vec3], mut plan: CutPlan) -> CellAssignment {
    let cell_count = plan.brackets.len() + 1;
    if cell_count == 1 {
        return CellAssignment { cells: Vec::new(), cell_count, bytes: 0 };
    }
    let cells: Vec<AtomicU16> = centers.par_iter().map(|_| AtomicU16::new(0)).collect();
    let undecided_bytes = loop {
        match cut_all(centers, &plan, &cells) {
            Ok(bytes) => break bytes,
            Err(BracketMiss { cuts }) => plan.widen(&cuts),
        }
    };
    let bytes = plan.bytes.max(size_of_val(&cells[..]) + undecided_bytes) as u64;
    CellAssignment { cells, cell_count, bytes }
}

/// The cuts whose medians are outside their brackets.
#[derive(Debug, Clone, PartialEq, Eq)]
struct BracketMiss {
    cuts: Vec<usize>,
}

/// Writes the cell of each particle. Returns the bytes that the undecided particles needed.
fn cut_all(centers: &[Vec3], plan: &CutPlan, cells: &[AtomicU16]) -> Result<usize, BracketMiss> {
    // Pass over the particles in parallel
    let parts = 4 * rayon::current_num_threads();
    let chunk_len = centers.len().div_ceil(parts).max(TASK_LEN);
    let chunks: Vec<PassCounts> = centers
        .par_chunks(chunk_len)
        .zip(cells.par_chunks(chunk_len))
        .enumerate()
        .map(|(chunk, (centers, cells))| pass(chunk * chunk_len, centers, cells, plan))
        .collect();
    // Add up the counts of the chunks
    let mut counts = vec![0; plan.brackets.len() + 1];
    for chunk in &chunks {
        for (count, more) in counts.iter_mut().zip(&chunk.counts) {
            *count += *more as usize;
        }
    }
    // Join the undecided particles of each cut, in order
    let mut undecided: Vec<Vec<u32>> = (0..plan.brackets.len())
        .into_par_iter()
        .map(|cut| {
            let lists: Vec<&[u32]> = chunks.iter().map(|c| &c.undecided[cut][..]).collect();
            lists.concat()
        })
        .collect();
    let capacity = |lists: &[Vec<u32>]| lists.iter().map(Vec::capacity).sum::<usize>();
    let held: usize = chunks.iter().map(|c| capacity(&c.undecided)).sum();
    let bytes = (held + capacity(&undecided)) * size_of::<u32>();
    drop(chunks);
    // Decide them
    let whole = CutSubtree {
        first_cut: 0,
        brackets: &plan.brackets,
        middles: &plan.middles,
        undecided: &mut undecided,
        first_cell: 0,
        counts: &mut counts,
    };
    whole.decide(centers, cells)?;
    Ok(bytes)
}

/// The result of a pass over some particles.
struct PassCounts {
    /// Particles in each cell.
    counts: Vec<u32>,
    /// The undecided particles of each cut.
    undecided: Vec<Vec<u32>>,
}

fn pass(first: usize, centers: &[Vec3], cells: &[AtomicU16], plan: &CutPlan) -> PassCounts {
    let brackets = &plan.brackets[..];
    let mut passed = PassCounts {
        counts: vec![0; brackets.len() + 1],
        undecided: vec![Vec::new(); brackets.len()],
    };
    for (offset, (center, own)) in centers.iter().zip(cells).enumerate() {
        let index = index_u32(first + offset);
        match descend(brackets, keys_of(*center, index)) {
            Side::Cell(cell) => {
                own.store(cell_u16(cell), Ordering::Relaxed);
                passed.counts[cell] += 1;
            }
            Side::Undecided(cut) => passed.undecided[cut].push(index),
        }
    }
    passed
}

#[inline(always)]
fn keys_of(center: Vec3, index: u32) -> [i64; 4] {
    [key(center.x, index), key(center.y, index), key(center.z, index), 0]
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the plan has at most 2^15 cells")]
fn cell_u16(cell: usize) -> u16 {
    cell as u16
}

/// A cut and all cuts below it.
struct CutSubtree<'a> {
    /// Index of the cut in the plan.
    first_cut: usize,
    brackets: &'a [MedianBracket],
    middles: &'a [usize],
    /// The undecided particles of each cut.
    undecided: &'a mut [Vec<u32>],
    /// Index of the lowest cell.
    first_cell: usize,
    /// The number of particles already decided for each cell.
    counts: &'a mut [usize],
}

impl<'a> CutSubtree<'a> {
    /// Decides all undecided particles.
    fn decide(self, centers: &[Vec3], cells: &[AtomicU16]) -> Result<(), BracketMiss> {
        let (Some(bracket), Some(middle)) = (self.brackets.first(), self.middles.first()) else {
            return Ok(());
        };
        if !bracket.is_cut() {
            // There are no cuts below either.
            return Ok(());
        }
        let cut = self.first_cut;
        let axis = bracket.axis();
        // Check that the median is among the undecided particles
        let own = std::mem::take(&mut self.undecided[0]);
        let (mut low, mut high) = self.halves();
        let Some(rank) = middle.checked_sub(low.len()).filter(|r| *r <= own.len()) else {
            return Err(BracketMiss { cuts: vec![cut] });
        };
        // Split them at the median
        let mut items: Vec<KeyedParticle> = own
            .par_iter()
            .with_min_len(UNDECIDED_TASK_LEN)
            .map(|index| KeyedParticle::new(centers[*index as usize], *index))
            .collect();
        drop(own);
        if rank < items.len() {
            items.select_nth_unstable_by_key(rank, |item| item.key(axis));
        }
        low.take(&items[..rank], cells);
        high.take(&items[rank..], cells);
        drop(items);
        // Decide the cuts below
        let (a, b) = rayon::join(|| low.decide(centers, cells), || high.decide(centers, cells));
        match (a, b) {
            (Err(mut a), Err(b)) => {
                a.cuts.extend(b.cuts);
                Err(a)
            }
            (a, b) => a.and(b),
        }
    }

    /// The subtrees below the cut: the low side and the high side.
    fn halves(self) -> (Self, Self) {
        let half = self.brackets.len() / 2;
        let (undecided_low, undecided_high) = self.undecided[1..].split_at_mut(half);
        let (counts_low, counts_high) = self.counts.split_at_mut(half + 1);
        let low = CutSubtree {
            first_cut: self.first_cut + 1,
            brackets: &self.brackets[1..=half],
            middles: &self.middles[1..=half],
            undecided: undecided_low,
            first_cell: self.first_cell,
            counts: counts_low,
        };
        let high = CutSubtree {
            first_cut: self.first_cut + 1 + half,
            brackets: &self.brackets[half + 1..],
            middles: &self.middles[half + 1..],
            undecided: undecided_high,
            first_cell: self.first_cell + half + 1,
            counts: counts_high,
        };
        (low, high)
    }

    /// Number of particles in the subtree, decided and undecided.
    fn len(&self) -> usize {
        let undecided: usize = self.undecided.iter().map(Vec::len).sum();
        self.counts.iter().sum::<usize>() + undecided
    }

    /// Adds particles that the cut above has decided.
    fn take(&mut self, items: &[KeyedParticle], cells: &[AtomicU16]) {
        let ways: Vec<Side> = items
            .par_iter()
            .with_min_len(UNDECIDED_TASK_LEN)
            .map(|item| {
                let way = descend(self.brackets, keys_of(item.center(), item.number()));
                if let Side::Cell(cell) = way {
                    let own = &cells[item.number() as usize];
                    own.store(cell_u16(self.first_cell + cell), Ordering::Relaxed);
                }
                way
            })
            .collect();
        for (item, way) in items.iter().zip(ways) {
            match way {
                Side::Cell(cell) => self.counts[cell] += 1,
                Side::Undecided(cut) => self.undecided[cut].push(item.number()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Vec3> {
        let unit = |i: u32, k: u32| {
            let hash = (i * 3 + k).wrapping_mul(0x9e37_79b9).rotate_left(13);
            hash.wrapping_mul(0x85eb_ca6b) as f32 / u32::MAX as f32
        };
        (0..200_000).map(|i| Vec3::new(unit(i, 0), unit(i, 1), unit(i, 2))).collect()
    }

    fn cells(assigned: &CellAssignment) -> Vec<usize> {
        (0..assigned.cells.len()).map(|i| assigned.cell(i)).collect()
    }

    #[test]
    fn cuts_are_exact() {
        let points = points();
        let plan = CutPlan::from_sample(&points);
        let (middle, axis) = (plan.middles[0], plan.brackets[0].axis());
        let assigned = assign(&points, plan);
        let half = assigned.cell_count / 2;
        let key = |i: usize| key(points[i][axis], index_u32(i));
        let (low, high): (Vec<usize>, Vec<usize>) =
            (0..points.len()).partition(|i| assigned.cell(*i) < half);
        assert_eq!(low.len(), middle);
        assert!(low.into_iter().map(key).max() < high.into_iter().map(key).min());
    }

    #[test]
    fn bracket_without_the_median_is_discarded() {
        let points = points();
        let expected = cells(&assign(&points, CutPlan::from_sample(&points)));
        let mut plan = CutPlan::from_sample(&points);
        let last = plan.brackets.iter().rposition(MedianBracket::is_cut);
        for cut in [0, 1, last.expect("more than one cell")] {
            let axis = index_u32(plan.brackets[cut].axis());
            plan.brackets[cut] = MedianBracket::between(key(0.9, 0), key(0.9, 1), axis);
        }
        assert!(cells(&assign(&points, plan)) == expected);
    }
}
