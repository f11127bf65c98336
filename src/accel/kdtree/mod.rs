//! `kdtree`: a k-d tree (Bentley 1975) with medians of the widest axis down to a block, folded into
//! implicit 8-wide levels: the fastest to trace.
//!
//! Cuts are at whole nodes ([`aligned_middle`]), so each aligned run of 16, 128, 1024... particles is a
//! cell of the tree and nothing but the order has to be found. The upper cuts are made without
//! moving anything (`plan.rs`, `assign.rs`): a sample says between which two particles each median must
//! lie, one pass over all particles decides all but those few, and these are then decided exactly.
//! One scatter (`partition.rs`) brings every particle into its cell of the cache's size, and the
//! cells are cut further one by one (`cell.rs`). All of it is parallel, and the cells are of equal
//! size however the particles are spread.
//!
//! Equal coordinates go by the particle's index, so the tree is one whatever the threads.

use glam::Vec3;
use rayon::prelude::*;

use super::block::BLOCK_SIZE;
use super::partition::{Cells, scatter};
use super::report::PhaseClock;
use super::upper::aligned_middle;
use super::wide::{UpperLevels, WideTree};
use super::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure};

mod assign;
mod cell;
mod item;
mod plan;

pub(in crate::accel) use plan::CELL_LEN;

use cell::CellScratch;
use plan::CutPlan;

/// Builds over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    let centers = spheres.centers;
    let common = match spheres.radius {
        SphereRadius::Common(radius) => Some(radius),
        SphereRadius::Each(_) => None,
    };
    // Radii of their own follow by index, so then the indices are needed while building.
    let indexed = settings.keep_indices || common.is_none();
    tree.reset(centers.len(), common, indexed);

    let plan = CutPlan::from_sample(centers);
    clock.lap("sample");
    let assigned = assign::assign(centers, plan);
    clock.lap("cuts");

    let (points, indices) = tree.points_mut();
    let cell_of = |index: usize, _: Vec3| assigned.cell(index);
    let cells = scatter(centers, assigned.cell_count, cell_of, points, indices);
    let scratch_bytes = assigned.bytes;
    drop(assigned);
    clock.lap("scatter");

    sort_cells(&cells, points, indices);
    clock.lap("cells");

    tree.pad_last_block();
    if let SphereRadius::Each(radii) = spheres.radius {
        tree.gather_radii(radii);
    }
    let sah_cost = tree.finish(UpperLevels::InOrder);
    if !settings.keep_indices {
        tree.drop_indices();
    }
    clock.lap("nodes");

    tree.report(
        Structure::Kdtree,
        "k-d, medians of the widest axis",
        sah_cost,
        scratch_bytes,
        clock.finish(),
    )
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
