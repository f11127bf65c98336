//! How much memory a build will take, before there are particles to build over.
//!
//! The same sums that [`super::BuildReport`] makes afterwards, from counts alone. Where a builder's
//! need depends on where the particles are, an even spread is assumed.

use super::block::{BLOCK_SIZE, Block, BlockRadii};
use super::node::{Node, WIDTH};
use super::partition;
use super::{Aabb, Structure};

/// What a tree is to be built over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildSize {
    /// Particles.
    pub particles: u64,
    /// Whether each has a radius of its own.
    pub own_radii: bool,
    /// See [`super::BuildSettings::keep_indices`].
    pub keep_indices: bool,
}

/// Bytes of a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BuildBytes {
    /// The finished tree.
    pub tree: u64,
    /// Held beside it at the peak of the build, the input not counted.
    pub scratch: u64,
}

/// What `structure` will hold while and after building.
pub fn predicted_bytes(structure: Structure, size: &BuildSize) -> BuildBytes {
    match structure {
        Structure::Lbvh => lbvh(size),
    }
}

/// Sorting happens in the memory of the tree (`lbvh.rs`); beside it there are the tables of the
/// scatter, and then the boxes of the lowest level (`wide.rs`). Crowded cells, of which an even
/// spread has none, take up to 32 bytes a particle of theirs on top.
fn lbvh(size: &BuildSize) -> BuildBytes {
    let blocks = block_count(size);
    let tree = whole_levels(blocks) + leaves(size, size.keep_indices);
    let boxes = blocks.div_ceil(WIDTH as u64) * size_of::<Aabb>() as u64;
    let tables = partition::table_bytes(size.particles);
    // Radii follow by index, so the indices are there until the end.
    let lent = leaves(size, size.keep_indices || size.own_radii) - leaves(size, size.keep_indices);
    BuildBytes {
        tree,
        scratch: lent + boxes.max(tables),
    }
}

fn block_count(size: &BuildSize) -> u64 {
    size.particles.div_ceil(BLOCK_SIZE as u64)
}

/// Blocks with what belongs to their particles.
fn leaves(size: &BuildSize, indexed: bool) -> u64 {
    let radii = if size.own_radii {
        size_of::<BlockRadii>()
    } else {
        0
    };
    let indices = if indexed { 4 * BLOCK_SIZE } else { 0 };
    block_count(size) * (size_of::<Block>() + radii + indices) as u64
}

/// Nodes of an implicit tree over so many blocks, and its table of places.
fn whole_levels(blocks: u64) -> u64 {
    let mut bytes = 0;
    let (mut count, mut level) = (blocks, 0);
    while count > 1 || level == 0 && count == 1 {
        count = count.div_ceil(WIDTH as u64);
        level += 1;
        bytes += count * size_of::<Node>() as u64;
        // The roots of the subtrees that are reordered: two levels up, if there is one above.
        if level == 2 && count > 1 {
            bytes += 4 * count;
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use spherule_formats::generate::{BoxSettings, fill_box};

    use super::*;
    use crate::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};

    /// Builds over an even spread and compares with what the builder says.
    #[track_caller]
    fn compare(structure: Structure, particles: usize, own_radii: bool, keep_indices: bool) {
        let centers = fill_box(&BoxSettings::thesis(particles, 1));
        let radii = vec![0.01; particles];
        let spheres = Spheres {
            centers: &centers,
            radius: if own_radii {
                SphereRadius::Each(&radii)
            } else {
                SphereRadius::Common(0.01)
            },
        };
        let settings = BuildSettings {
            keep_indices,
            ..BuildSettings::new(structure)
        };
        let report = TreeBuilder::new().build(&spheres, &settings);
        let size = BuildSize {
            particles: particles as u64,
            own_radii,
            keep_indices,
        };
        let predicted = predicted_bytes(structure, &size);
        let built = report.position_bytes + report.structure_bytes;
        let (low, high) = (predicted.tree * 85 / 100, predicted.tree * 115 / 100);
        assert!(
            (low..=high).contains(&built),
            "{structure} over {particles}: {built} bytes, predicted {predicted:?}"
        );
        let (peak, bound) = (report.peak_bytes, predicted.tree + predicted.scratch);
        assert!(
            peak <= bound * 115 / 100,
            "{structure} over {particles}: a peak of {peak} bytes, predicted {predicted:?}"
        );
    }

    #[test]
    fn builders_take_what_was_predicted() {
        for structure in Structure::ALL {
            for particles in [0, 1, 17, 1000, 20_000] {
                for (own_radii, keep) in [(false, false), (false, true), (true, false)] {
                    compare(structure, particles, own_radii, keep);
                }
            }
        }
    }

    #[test]
    fn trees_of_whole_levels_are_counted_exactly() {
        for (particles, bytes) in [
            (0, 0),
            (16, 192 + 64),
            (16 * 8, 8 * 192 + 64),
            (16 * 9, 9 * 192 + 3 * 64),
            (16 * 65, 65 * 192 + 12 * 64 + 2 * 4),
        ] {
            let size = BuildSize {
                particles,
                own_radii: false,
                keep_indices: false,
            };
            assert_eq!(
                predicted_bytes(Structure::Lbvh, &size).tree,
                bytes,
                "{particles}"
            );
        }
    }
}
