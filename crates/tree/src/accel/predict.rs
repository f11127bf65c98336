//! Predicts the memory of a build from the particle count.
//!
//! The sums are those of [`super::BuildReport`], computed from counts alone. If the memory of a builder depends on
//! the distribution of the particles, an even distribution is assumed.

use super::lbvh::{CELL_SCRATCH, LARGE_CELL};
use super::topology::Link;
use super::{Aabb, BuildSettings, BvhLeaves, BvhPreset, Structure};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii};
use crate::blocks::{Node, WIDTH};
use crate::order::{kd, partition};

/// Memory of a build, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BuildBytes {
    /// The finished tree.
    pub tree: u64,
    /// Memory next to the tree at the peak of the build, without the input.
    pub scratch: u64,
}

/// Predicted memory of a build over `particles`, with or without a radius per particle (`own_radii`).
pub fn predicted_bytes(settings: &BuildSettings, particles: u64, own_radii: bool) -> BuildBytes {
    let size = Size { particles, own_radii, keep_indices: settings.keep_indices };
    match settings.structure {
        Structure::Lbvh => size.lbvh(),
        Structure::Kdtree => size.kdtree(),
        Structure::Bvh => match settings.bvh.leaves {
            BvhLeaves::Blocks => size.bvh_of_blocks(),
            BvhLeaves::Particles => size.bvh_of_particles(settings.bvh.preset),
        },
        Structure::Sbvh => size.sbvh(settings.sbvh.budget),
    }
}

/// Upper bound of the memory of the threads that sort the cells of a [`Structure::Lbvh`] over `particles` that fill an
/// eighth of the cube around them, such as the drops of a block of water. For an even distribution it is negligible.
pub fn sorting_bytes(particles: u64) -> u64 {
    let count = usize::try_from(particles).unwrap_or(usize::MAX);
    let levels = partition::Cells::levels_for(count).saturating_sub(1);
    let cell = (particles >> (3 * levels)).min(LARGE_CELL as u64);
    CELL_SCRATCH * particles.min(cell * rayon::current_num_threads() as u64)
}

/// Predicted memory of a [`super::stored::StoredTree`] over `particles`, without the frame.
pub fn predicted_stored_bytes(particles: u64) -> BuildBytes {
    let blocks = particles.div_ceil(BLOCK_SIZE as u64);
    let stored = blocks.div_ceil(WIDTH as u64);
    let (levels, places) = whole_levels(blocks);
    let levels = levels - stored * size_of::<Node>() as u64;
    let ordered = stored.div_ceil(WIDTH as u64);
    BuildBytes {
        tree: levels + places,
        scratch: ordered * (size_of::<Node>() + 2 * size_of::<Aabb>()) as u64,
    }
}

/// Nodes per block of a tree with links. With eight children per node it would be 0.14, but nodes collapsed from
/// binary ones have 3.8 children on average (thesis's box, 1e5 to 1e7).
const NODES_PER_BLOCK: f64 = 0.357;
/// Bytes that clustering (`ploc.rs`) needs per item, with 64-bit codes.
const CLUSTER_BYTES: u64 = 208;
/// The same with 128-bit codes.
const CLUSTER_BYTES_HIGH: u64 = 224;
/// Average number of particles in a block of clustered particles.
const CLUSTERED_FILL: f64 = 10.9;
/// Average number of particles in a block of a tree with splits by cost.
const SPLIT_FILL: f64 = 15.0;
/// Bytes per reference while splits are searched.
const REFERENCE_BYTES: f64 = 28.0;
/// Bytes of the binary tree per reference.
const SPLIT_TREE_BYTES: f64 = 8.5;
/// Bytes per particle while the upper medians are found: its cell, and the undecided part.
const CUT_BYTES: u64 = 4;

/// Size of the input of a build.
struct Size {
    particles: u64,
    own_radii: bool,
    keep_indices: bool,
}

impl Size {
    /// The sort works in the memory of the tree (`lbvh.rs`). Additional memory holds the tables of the scatter, then
    /// the boxes of the lowest level (`wide.rs`). Crowded cells, which do not occur in an even distribution, need up
    /// to 32 bytes for each of their particles.
    fn lbvh(&self) -> BuildBytes {
        let tables = partition::table_bytes(self.particles);
        let (levels, places) = whole_levels(self.blocks());
        self.in_place(levels + places, tables)
    }

    /// As lbvh, but without reordered top levels, and with a search for the upper cuts.
    fn kdtree(&self) -> BuildBytes {
        let cuts =
            if self.particles > kd::CELL_LEN as u64 { CUT_BYTES * self.particles } else { 0 };
        self.in_place(whole_levels(self.blocks()).0, cuts)
    }

    /// A build that sorts in the memory of the tree.
    fn in_place(&self, nodes: u64, sorting: u64) -> BuildBytes {
        let boxes = self.blocks().div_ceil(WIDTH as u64) * size_of::<Aabb>() as u64;
        BuildBytes {
            tree: nodes + self.leaves(self.blocks(), self.keep_indices),
            scratch: self.temporary_index_bytes() + boxes.max(sorting),
        }
    }

    /// Clusters the same blocks as lbvh.
    fn bvh_of_blocks(&self) -> BuildBytes {
        let blocks = self.blocks();
        let tables = partition::table_bytes(self.particles);
        BuildBytes {
            tree: linked_nodes(blocks) + self.leaves(blocks, self.keep_indices),
            scratch: self.temporary_index_bytes()
                + tables.max(blocks * (CLUSTER_BYTES + size_of::<Aabb>() as u64)),
        }
    }

    /// The clustering ends before any memory of the tree is in use.
    fn bvh_of_particles(&self, preset: BvhPreset) -> BuildBytes {
        let tree = self.linked_tree_bytes(CLUSTERED_FILL);
        let each = match preset {
            BvhPreset::High => CLUSTER_BYTES_HIGH,
            BvhPreset::Fast | BvhPreset::Medium => CLUSTER_BYTES,
        };
        BuildBytes { tree, scratch: (self.particles * each).saturating_sub(tree) }
    }

    /// With equal spheres almost no references are split. With a radius per particle the whole budget may be used;
    /// the scratch includes it.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an estimate; the budget is at least 0"
    )]
    fn sbvh(&self, budget: f32) -> BuildBytes {
        let tree = self.linked_tree_bytes(SPLIT_FILL);
        let budget = f64::from(budget);
        let references = self.particles as f64 * (1.0 + budget) * REFERENCE_BYTES;
        let binary = self.particles as f64 * SPLIT_TREE_BYTES;
        let copies = if self.own_radii { tree as f64 * budget } else { 0.0 };
        BuildBytes { tree, scratch: (references + binary + copies) as u64 }
    }

    /// Number of full blocks, plus one if particles are left over.
    fn blocks(&self) -> u64 {
        self.particles.div_ceil(BLOCK_SIZE as u64)
    }

    /// Bytes of blocks with the radii and indices of their particles.
    fn leaves(&self, blocks: u64, indexed: bool) -> u64 {
        let radii = if self.own_radii { size_of::<BlockRadii>() } else { 0 };
        let indices = if indexed { 4 * BLOCK_SIZE } else { 0 };
        blocks * (size_of::<Block>() + radii + indices) as u64
    }

    /// Bytes of indices that exist only during the build, because radii are gathered by index.
    fn temporary_index_bytes(&self) -> u64 {
        if self.own_radii && !self.keep_indices { self.blocks() * 4 * BLOCK_SIZE as u64 } else { 0 }
    }

    /// Bytes of a tree with links over blocks of `fill` particles; such a tree always has indices.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an estimate of what is not negative"
    )]
    fn linked_tree_bytes(&self, fill: f64) -> u64 {
        let blocks = (self.particles as f64 / fill).ceil() as u64;
        linked_nodes(blocks) + self.leaves(blocks, true)
    }
}

/// Bytes of nodes and links over `blocks`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an estimate of what is not negative"
)]
fn linked_nodes(blocks: u64) -> u64 {
    let nodes = (blocks as f64 * NODES_PER_BLOCK).ceil() as u64;
    nodes * (size_of::<Node>() + size_of::<Link>()) as u64
}

/// Bytes of the nodes of an implicit tree over `blocks`, and of its order table (see `top_levels.rs`).
fn whole_levels(blocks: u64) -> (u64, u64) {
    let (mut nodes, mut places) = (0, 0);
    let (mut count, mut level) = (blocks, 0);
    while count > 1 || level == 0 && count == 1 {
        count = count.div_ceil(WIDTH as u64);
        level += 1;
        nodes += count * size_of::<Node>() as u64;
        // The reordered subtrees have their roots two levels above the blocks, if there is a level above that.
        if level == 2 && count > 1 {
            places = 4 * count;
        }
    }
    (nodes, places)
}

#[cfg(test)]
mod tests {
    use spherule_frame::generate::{BoxSettings, fill_box};

    use super::*;
    use crate::accel::{BvhSettings, SphereRadius, Spheres, TreeBuilder};

    /// Builds over an even distribution and compares with the report of the builder.
    #[track_caller]
    fn compare(settings: &BuildSettings, particles: usize, own_radii: bool) {
        let centers = fill_box(&BoxSettings::thesis(particles, 1));
        // Half the mean spacing, as in the thesis.
        #[expect(clippy::cast_possible_truncation, reason = "a radius")]
        let radius = 0.5 * (48.0 / particles.max(1) as f64).cbrt() as f32;
        let radii = vec![radius; particles];
        let spheres = Spheres {
            centers: &centers,
            radius: if own_radii {
                SphereRadius::Each(&radii)
            } else {
                SphereRadius::Common(radius)
            },
        };
        let report = TreeBuilder::new().build(&spheres, settings);
        let predicted = predicted_bytes(settings, particles as u64, own_radii);
        let built = report.position_bytes + report.structure_bytes;
        // The fill of few blocks varies.
        let slack = if particles < 10_000 { 1024 + particles as u64 * 12 } else { 0 };
        let (low, high) = (predicted.tree * 85 / 100, predicted.tree * 115 / 100);
        assert!(
            (low.saturating_sub(slack)..=high + slack).contains(&built),
            "{settings:?} over {particles}: {built} bytes, predicted {predicted:?}"
        );
        let (peak, bound) = (report.peak_bytes, predicted.tree + predicted.scratch);
        assert!(
            peak <= bound * 115 / 100 + slack,
            "{settings:?} over {particles}: a peak of {peak} bytes, predicted {predicted:?}"
        );
    }

    #[test]
    fn builders_use_the_predicted_memory() {
        let particles = BvhSettings { leaves: BvhLeaves::Particles, ..BvhSettings::default() };
        let over_particles = BuildSettings { bvh: particles, ..BuildSettings::new(Structure::Bvh) };
        let plain = Structure::ALL.map(BuildSettings::new);
        for settings in plain.into_iter().chain([over_particles]) {
            for particles in [0, 1, 17, 1000, 40_000] {
                for (own_radii, keep_indices) in [(false, false), (false, true), (true, false)] {
                    let settings = BuildSettings { keep_indices, ..settings };
                    compare(&settings, particles, own_radii);
                }
            }
        }
    }

    #[test]
    fn trees_of_whole_levels_are_counted_exactly() {
        let settings = BuildSettings { keep_indices: false, ..BuildSettings::new(Structure::Lbvh) };
        for (particles, bytes) in [
            (0, 0),
            (16, 192 + 64),
            (16 * 8, 8 * 192 + 64),
            (16 * 9, 9 * 192 + 3 * 64),
            (16 * 65, 65 * 192 + 12 * 64 + 2 * 4),
        ] {
            let predicted = predicted_bytes(&settings, particles, false);
            assert_eq!(predicted.tree, bytes, "{particles}");
        }
    }
}
