//! The order of a k-d tree (Bentley 1975): medians of the widest axis down to a block.
//!
//! Cuts are at whole nodes ([`aligned_middle`]), so each aligned run of 16, 128, 1024... particles is a
//! cell of the tree and nothing but the order has to be found. The upper cuts are made without
//! moving anything (`plan.rs`, `assign.rs`): a sample bounds the particles between which each median must
//! lie, one pass over all particles decides all but those few, and these are then decided exactly.
//! One scatter (`partition.rs`) brings every particle into its cell of the cache's size, and the
//! cells are cut further one by one (`cell.rs`). All of it is parallel, and the cells are of equal
//! size however the particles are spread.
//!
//! Equal coordinates go by the particle's index, so the order is one whatever the threads.

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

/// Writes `centers` into `points` in the order of the tree, and their indices into `indices` unless
/// that is empty. `lap` is called when a phase ends: `sample`, `cuts`, `scatter`, `cells`. Returns the
/// most bytes held beside the two.
///
/// # Panics
/// If `points` (or a non-empty `indices`) is shorter than `centers`, or there are 2^32 or more.
pub fn order_into(
    centers: &[Vec3],
    points: &mut [Vec3],
    indices: &mut [u32],
    mut lap: impl FnMut(&'static str),
) -> u64 {
    let plan = CutPlan::from_sample(centers);
    lap("sample");
    let assigned = assign::assign(centers, plan);
    lap("cuts");

    let cell_of = |index: usize, _: Vec3| assigned.cell(index);
    let cells = scatter(centers, assigned.cell_count, cell_of, points, indices);
    let scratch_bytes = assigned.bytes;
    drop(assigned);
    lap("scatter");

    sort_cells(&cells, points, indices);
    lap("cells");
    scratch_bytes
}

/// Where to cut `len` subtrees (or blocks) in two so that both sides are whole nodes: a multiple of
/// the largest power of 8 below `len`. 0 when there is nothing to cut.
pub fn aligned_middle(len: usize) -> usize {
    let mut unit = 1;
    while unit * WIDTH < len {
        unit *= WIDTH;
    }
    let children = len.div_ceil(unit);
    (children / 2) * unit
}

/// Where to cut `len` particles in two so that nodes stay whole; 0 when they fit a block.
fn middle_of(len: usize) -> usize {
    aligned_middle(len.div_ceil(BLOCK_SIZE)) * BLOCK_SIZE
}

/// Cuts every cell down to blocks.
fn sort_cells(cells: &Cells, points: &mut [Vec3], indices: &mut [u32]) {
    cells
        .slices_of(points, indices)
        .into_par_iter()
        .for_each_init(CellScratch::default, |scratch, (points, indices)| {
            scratch.sort(points, indices);
        });
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
