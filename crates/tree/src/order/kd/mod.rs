//! The order of a k-d tree (Bentley 1975): cuts at the median of the widest axis, down to a block.
//!
//! Cuts are at whole nodes ([`aligned_middle`]), so that each aligned run of 16, 128, 1024... particles is a
//! cell of the tree, and the order alone defines the tree. The upper cuts are found without moving any particle
//! (`plan.rs`, `assign.rs`): a sample bounds the particles between which each median must lie, one pass over
//! all particles decides all except those few, and these are then decided exactly. One scatter (`partition.rs`)
//! moves every particle into its cell, which fits into the cache. The cells are then cut further, one by one
//! (`cell.rs`). All steps are parallel, and the cells have equal sizes for any distribution of the particles.
//!
//! Particles with equal coordinates are ordered by index, so that the order does not depend on the number of threads.

use glam::Vec3;
use rayon::prelude::*;

use super::partition::{Cells, scatter};
use crate::blocks::{BLOCK_SIZE, WIDTH};

mod assign;
mod cell;
mod item;
mod plan;

pub use plan::CELL_LEN;

use cell::CellScratch;
use plan::CutPlan;

/// Writes `centers` into `points` in the order of the tree, and their indices into `indices` unless that is
/// empty. Calls `lap` at the end of each phase: `sample`, `cuts`, `scatter`, `cells`. Returns the peak bytes
/// held beside these slices.
///
/// # Panics
/// If `points` (or a non-empty `indices`) is shorter than `centers`, or there are 2^32 or more.
pub fn order_into(
    centers: &[Vec3],
    points: &mut [Vec3],
    indices: &mut [u32],
    mut lap: impl FnMut(&'static str),
) -> u64 {
    // Bound the medians of the upper cuts
    let plan = CutPlan::from_sample(centers);
    lap("sample");
    // Assign each particle to a cell
    let assigned = assign::assign(centers, plan);
    lap("cuts");

    // Move the particles to their cells
    let cell_of = |index: usize, _: Vec3| assigned.cell(index);
    let cells = scatter(centers, assigned.cell_count, cell_of, points, indices);
    let scratch_bytes = assigned.bytes;
    drop(assigned);
    lap("scatter");

    // Sort within the cells
    sort_cells(&cells, points, indices);
    lap("cells");
    scratch_bytes
}

/// The position at which to cut `len` subtrees (or blocks) so that both sides are whole nodes: a multiple of
/// the largest power of 8 below `len`; 0 if there is nothing to cut.
pub fn aligned_middle(len: usize) -> usize {
    let mut unit = 1;
    while unit * WIDTH < len {
        unit *= WIDTH;
    }
    let children = len.div_ceil(unit);
    (children / 2) * unit
}

/// The position at which to cut `len` particles so that nodes stay whole; 0 if they fit into a block.
fn middle_of(len: usize) -> usize {
    aligned_middle(len.div_ceil(BLOCK_SIZE)) * BLOCK_SIZE
}

/// Cuts every cell into blocks.
fn sort_cells(cells: &Cells, points: &mut [Vec3], indices: &mut [u32]) {
    cells.slices_of(points, indices).into_par_iter().for_each_init(
        CellScratch::default,
        |scratch, (points, indices)| {
            scratch.sort(points, indices);
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_keep_nodes_whole() {
        assert_eq!(aligned_middle(0), 0);
        assert_eq!(aligned_middle(1), 0);
        assert_eq!(aligned_middle(2), 1);
        assert_eq!(aligned_middle(8), 4);
        assert_eq!(aligned_middle(9), 8);
        assert_eq!(aligned_middle(64), 32);
        assert_eq!(aligned_middle(65), 64);
        assert_eq!(aligned_middle(9766), 2 * 4096 / 2);
    }
}
