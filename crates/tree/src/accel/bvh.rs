//! `bvh`: a bounding volume hierarchy built from the leaves up by clustering and reinsertion (`ploc.rs`), then
//! collapsed into 8-wide nodes (`collapse.rs`).
//!
//! By default the leaves are the blocks that the sort of `lbvh` makes. There are 16 times fewer blocks than
//! particles, so clustering is cheaper by about that factor. If single particles are clustered, blocks are formed
//! from the resulting tree.
//!
//! Measured on equal spheres: the thesis's box with 1e6 particles, alternating with `lbvh`, 2 threads of an AMD Zen 5
//! with AVX-512. The machine was busy during the runs of the last row; its ratios are from runs side by side.
//!
//! | leaves, preset | build | primary | shadow | reflection | bytes per particle, peak |
//! |---|---|---|---|---|---|
//! | lbvh | 0.033 s | 1 | 1 | 1 | 12.6, 14.9 |
//! | blocks, fast | 0.060 s | 1.04 | 1.09 | 1.09 | 13.6, 27 |
//! | blocks, medium | 0.060 s | 1.06 | 1.09 | 1.09 | 13.7, 27 |
//! | blocks, high | 0.080 s | 1.05 | 1.10 | 1.08 | 13.5, 27 |
//! | particles, medium | 15 to 32 x lbvh | 1.07 to 1.12 | 0.97 to 1.20 | 1.08 to 1.22 | 25.8, 208 |
//!
//! So over blocks, presets above the first do not pay off.

use rayon::prelude::*;

use super::collapse::{Collapsed, Content, collapse};
use super::ploc::{Clustered, cluster};
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{Aabb, BuildReport, BuildSettings, BvhLeaves, SphereRadius, Spheres, Structure, lbvh};
use crate::blocks::Block;

/// Builds a tree over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    match settings.bvh.leaves {
        BvhLeaves::Blocks => build_over_blocks(tree, spheres, settings),
        BvhLeaves::Particles => build_over_particles(tree, spheres, settings),
    }
}

fn build_over_blocks(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    // Sort the particles into blocks along the Hilbert curve
    let sort_bytes = lbvh::sort_into_blocks(tree, spheres, settings.keep_indices, &mut clock);
    tree.blocks.par_iter_mut().with_min_len(256).for_each(Block::transpose_points);

    // Cluster the boxes of the blocks into a binary tree
    let padding = tree.padding;
    let bounds_of = |block: usize| match tree.radii.get(block) {
        Some(radii) => tree.blocks[block].sphere_bounds(radii),
        None => tree.blocks[block].bounds().padded(padding),
    };
    let clustered = cluster(tree.blocks.len(), bounds_of, padding, settings.bvh.preset, &mut clock);
    // Collapse the binary tree into 8-wide nodes
    let held = clustered.peak_bytes.max(sort_bytes);
    let Collapsed { sah_cost, scratch_bytes } =
        collapse(tree, clustered.tree, &Content::Blocks, &mut clock);
    if !settings.keep_indices {
        tree.drop_indices();
    }
    tree.report(
        Structure::Bvh,
        "clustered blocks along a hilbert curve",
        sah_cost,
        held.max(scratch_bytes),
        clock.finish(),
    )
}

fn build_over_particles(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    // Cluster the boxes of the particles into a binary tree
    let (common, each): (f32, &[f32]) = match spheres.radius {
        SphereRadius::Common(radius) => (radius, &[]),
        SphereRadius::Each(radii) => (0.0, radii),
    };
    let bounds_of = |particle: usize| {
        let radius = each.get(particle).copied().unwrap_or(common);
        let center = spheres.centers[particle];
        Aabb { min: center - radius, max: center + radius }
    };
    let Clustered { tree: binary, peak_bytes } =
        cluster(spheres.centers.len(), bounds_of, common, settings.bvh.preset, &mut clock);
    // Pack the particles into blocks and collapse the binary tree into 8-wide nodes
    let collapsed = collapse(tree, binary, &Content::Particles(*spheres), &mut clock);
    let mut report = tree.report(
        Structure::Bvh,
        "clustered particles",
        collapsed.sah_cost,
        collapsed.scratch_bytes,
        clock.finish(),
    );
    // The clustering ends before any memory of the tree is in use, so its peak is not added to the tree.
    report.peak_bytes = report.peak_bytes.max(peak_bytes);
    report
}
