//! How much memory a build will take, before there are particles to build over.
//!
//! The same sums that [`super::BuildReport`] makes afterwards, from counts alone. Where a builder's
//! need depends on where the particles are, an even spread is assumed.

use super::topology::Link;
use super::{Aabb, BuildSettings, BvhLeaves, BvhPreset, Structure};
use spherule_formats::blocks::{BLOCK_SIZE, Block, BlockRadii};
use spherule_formats::blocks::{Node, WIDTH};
use spherule_formats::order::{kd, partition};

/// Bytes of a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BuildBytes {
    /// The finished tree.
    pub tree: u64,
    /// Held beside it at the peak of the build, the input not counted.
    pub scratch: u64,
}

/// What a build over `particles`, each with a radius of its own or not, will hold.
pub fn predicted_bytes(settings: &BuildSettings, particles: u64, own_radii: bool) -> BuildBytes {
    let size = Size {
        particles,
        own_radii,
        keep_indices: settings.keep_indices,
    };
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

/// What a [`super::stored::StoredTree`] over `particles` will hold beside the frame.
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

/// Nodes for each block of a tree of links: eight blocks or nodes under each would be 0.14, but
/// nodes made of binary ones have 3.8 children on average (thesis's box, 1e5 to 1e7).
const NODES_PER_BLOCK: f64 = 0.357;
/// Bytes that clustering (`ploc.rs`) holds for each thing clustered, and with 128-bit codes.
const CLUSTER_BYTES: u64 = 208;
const CLUSTER_BYTES_HIGH: u64 = 224;
/// Particles in a block of clustered particles, on average; and where splits go by cost.
const CLUSTERED_FILL: f64 = 10.9;
const SPLIT_FILL: f64 = 15.0;
/// Bytes of a reference while splits are looked for, and of the binary tree for each.
const REFERENCE_BYTES: f64 = 28.0;
const SPLIT_TREE_BYTES: f64 = 8.5;
/// Bytes of a particle while upper medians are found: its cell, and the part that is undecided.
const CUT_BYTES: u64 = 4;

/// What a tree is to be built over.
struct Size {
    particles: u64,
    own_radii: bool,
    keep_indices: bool,
}

impl Size {
    /// Sorting happens in the memory of the tree (`lbvh.rs`); beside it there are the tables of the
    /// scatter, and then the boxes of the lowest level (`wide.rs`). Crowded cells, of which an even
    /// spread has none, take up to 32 bytes a particle of theirs on top.
    fn lbvh(&self) -> BuildBytes {
        let tables = partition::table_bytes(self.particles);
        let (levels, places) = whole_levels(self.blocks());
        self.in_place(levels + places, tables)
    }

    /// As lbvh, without another order of the upper levels; but first the upper cuts are found.
    fn kdtree(&self) -> BuildBytes {
        let cuts = if self.particles > kd::CELL_LEN as u64 {
            CUT_BYTES * self.particles
        } else {
            0
        };
        self.in_place(whole_levels(self.blocks()).0, cuts)
    }

    /// Sorted in the memory of the tree.
    fn in_place(&self, nodes: u64, sorting: u64) -> BuildBytes {
        let boxes = self.blocks().div_ceil(WIDTH as u64) * size_of::<Aabb>() as u64;
        BuildBytes {
            tree: nodes + self.leaves(self.blocks(), self.keep_indices),
            scratch: self.lent() + boxes.max(sorting),
        }
    }

    /// Blocks as those of lbvh, clustered.
    fn bvh_of_blocks(&self) -> BuildBytes {
        let blocks = self.blocks();
        let tables = partition::table_bytes(self.particles);
        BuildBytes {
            tree: linked_nodes(blocks) + self.leaves(blocks, self.keep_indices),
            scratch: self.lent() + tables.max(blocks * (CLUSTER_BYTES + size_of::<Aabb>() as u64)),
        }
    }

    /// Nothing of the tree is there yet while particles are clustered.
    fn bvh_of_particles(&self, preset: BvhPreset) -> BuildBytes {
        let tree = self.gathered(CLUSTERED_FILL);
        let each = match preset {
            BvhPreset::High => CLUSTER_BYTES_HIGH,
            BvhPreset::Fast | BvhPreset::Medium => CLUSTER_BYTES,
        };
        BuildBytes {
            tree,
            scratch: (self.particles * each).saturating_sub(tree),
        }
    }

    /// Of equal spheres hardly any are split. Where radii differ the whole budget may be used, for
    /// which there is room in the scratch.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an estimate; the budget is at least 0"
    )]
    fn sbvh(&self, budget: f32) -> BuildBytes {
        let tree = self.gathered(SPLIT_FILL);
        let budget = f64::from(budget);
        let references = self.particles as f64 * (1.0 + budget) * REFERENCE_BYTES;
        let binary = self.particles as f64 * SPLIT_TREE_BYTES;
        let copies = if self.own_radii {
            tree as f64 * budget
        } else {
            0.0
        };
        BuildBytes {
            tree,
            scratch: (references + binary + copies) as u64,
        }
    }

    /// Blocks of which the last may be unfilled.
    fn blocks(&self) -> u64 {
        self.particles.div_ceil(BLOCK_SIZE as u64)
    }

    /// Blocks with what belongs to their particles.
    fn leaves(&self, blocks: u64, indexed: bool) -> u64 {
        let radii = if self.own_radii {
            size_of::<BlockRadii>()
        } else {
            0
        };
        let indices = if indexed { 4 * BLOCK_SIZE } else { 0 };
        blocks * (size_of::<Block>() + radii + indices) as u64
    }

    /// Radii follow by index, so indices that are not kept are there until the end.
    fn lent(&self) -> u64 {
        if self.own_radii && !self.keep_indices {
            self.blocks() * 4 * BLOCK_SIZE as u64
        } else {
            0
        }
    }

    /// A tree of links over blocks of `fill` particles, which always has indices.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an estimate of what is not negative"
    )]
    fn gathered(&self, fill: f64) -> u64 {
        let blocks = (self.particles as f64 / fill).ceil() as u64;
        linked_nodes(blocks) + self.leaves(blocks, true)
    }
}

/// Nodes and links over so many blocks.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an estimate of what is not negative"
)]
fn linked_nodes(blocks: u64) -> u64 {
    let nodes = (blocks as f64 * NODES_PER_BLOCK).ceil() as u64;
    nodes * (size_of::<Node>() + size_of::<Link>()) as u64
}

/// Nodes of an implicit tree over so many blocks, and its table of places (see `upper.rs`).
fn whole_levels(blocks: u64) -> (u64, u64) {
    let (mut nodes, mut places) = (0, 0);
    let (mut count, mut level) = (blocks, 0);
    while count > 1 || level == 0 && count == 1 {
        count = count.div_ceil(WIDTH as u64);
        level += 1;
        nodes += count * size_of::<Node>() as u64;
        // The roots of the subtrees that are reordered: two levels up, if there is one above.
        if level == 2 && count > 1 {
            places = 4 * count;
        }
    }
    (nodes, places)
}

#[cfg(test)]
mod tests {
    use spherule_formats::generate::{BoxSettings, fill_box};

    use super::*;
    use crate::accel::{BvhSettings, SphereRadius, Spheres, TreeBuilder};

    /// Builds over an even spread and compares with what the builder says.
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
        // Few blocks are filled by chance.
        let slack = if particles < 10_000 {
            1024 + particles as u64 * 12
        } else {
            0
        };
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
    fn builders_take_what_was_predicted() {
        let particles = BvhSettings {
            leaves: BvhLeaves::Particles,
            ..BvhSettings::default()
        };
        let over_particles = BuildSettings {
            bvh: particles,
            ..BuildSettings::new(Structure::Bvh)
        };
        let plain = Structure::ALL.map(BuildSettings::new);
        for settings in plain.into_iter().chain([over_particles]) {
            for particles in [0, 1, 17, 1000, 40_000] {
                for (own_radii, keep_indices) in [(false, false), (false, true), (true, false)] {
                    let settings = BuildSettings {
                        keep_indices,
                        ..settings
                    };
                    compare(&settings, particles, own_radii);
                }
            }
        }
    }

    #[test]
    fn trees_of_whole_levels_are_counted_exactly() {
        let settings = BuildSettings {
            keep_indices: false,
            ..BuildSettings::new(Structure::Lbvh)
        };
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
