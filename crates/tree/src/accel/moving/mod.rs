//! A tree over spheres that move along straight lines while a shutter is open, for rays that each have a time.
//!
//! Its topology is that of a tree over the spheres in the middle of the exposure. Boxes move as well: each plane is a
//! linear function of time, such that the box contains its spheres when the shutter opens and when it closes, and
//! therefore always in between (Christensen et al., "Ray differentials and multiresolution geometry caching for
//! distribution ray tracing in complex scenes", 2003, section 4.3). A ray tests boxes and spheres at its own time.

use glam::Vec3;
use rayon::prelude::*;

use super::Aabb;
use super::view::TreeView;
use crate::blocks::BLOCK_SIZE;
use crate::math::Supported;

mod hybrid;
mod node;
mod refit;
mod single;
#[cfg(test)]
mod tests;

use node::{MovingBlock, MovingNode};

/// Largest distance by which a sphere may move during an exposure, scene units. Those that would move farther, and
/// those whose motion is not a number, do not move.
const MAX_DISPLACEMENT: f32 = 1e15;

/// The tree, see the module. Times are from -1/2, when the shutter opens, to 1/2, when it closes.
#[derive(Debug, Default)]
pub struct MovingTree {
    nodes: Vec<MovingNode>,
    blocks: Vec<MovingBlock>,
    /// The particle in each slot. The last one of a block may be repeated.
    indices: Vec<u32>,
    /// Bounding box of the spheres during the whole exposure.
    bounds: Aabb,
    simd: Supported,
}

impl MovingTree {
    /// Builds over the spheres of `tree`, which has indices and contains each sphere once, in the middle of the
    /// exposure. `displacements` are by how far each particle moves from the opening of the shutter to its closing,
    /// scene units.
    ///
    /// # Panics
    /// If there are fewer displacements than particles.
    pub fn build(&mut self, tree: &TreeView<'_>, displacements: &[Vec3]) {
        self.simd = Supported::or_best(tree.simd());
        // Copy the spheres in tree order, with their motion
        self.indices.clear();
        self.indices.extend_from_slice(tree.indices);
        let indices = &self.indices;
        let block = |number: usize| {
            let mut block = MovingBlock::default();
            for lane in 0..BLOCK_SIZE {
                let slot = number * BLOCK_SIZE + lane;
                let (center, radius) = tree.sphere(crate::order::index_u32(slot));
                let displacement = bounded(displacements[indices[slot] as usize]);
                block.set(lane, center, displacement, radius);
            }
            block
        };
        let blocks = (0..indices.len() / BLOCK_SIZE).into_par_iter();
        blocks.with_min_len(256).map(block).collect_into_vec(&mut self.blocks);
        // Compute the boxes from the blocks up
        self.nodes = refit::nodes_over(tree, &self.blocks);
        self.bounds = (self.nodes.first()).map_or(Aabb::EMPTY, MovingNode::swept_bounds);
    }

    /// The particle in `slot`.
    ///
    /// # Panics
    /// If the slot does not exist.
    pub fn particle(&self, slot: u32) -> u32 {
        self.indices[slot as usize]
    }

    /// Centre at `time` and radius of the sphere in `slot`.
    ///
    /// # Panics
    /// If the slot does not exist.
    pub fn sphere(&self, slot: u32, time: f32) -> (Vec3, f32) {
        let slot = slot as usize;
        self.blocks[slot / BLOCK_SIZE].sphere(slot % BLOCK_SIZE, time)
    }

    /// Whether there are no spheres.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Memory in bytes.
    pub fn byte_len(&self) -> u64 {
        let nodes = size_of_val(&self.nodes[..]);
        (nodes + size_of_val(&self.blocks[..]) + size_of_val(&self.indices[..])) as u64
    }

    /// Estimate of [`Self::byte_len`] for `particles`, rounded up.
    pub fn predicted_bytes(particles: u64) -> u64 {
        let block = size_of::<MovingBlock>() + BLOCK_SIZE * size_of::<u32>();
        // A ninth of the places in blocks may be empty, with `bvh`, and nodes may have fewer than eight children
        let blocks = particles.div_ceil(BLOCK_SIZE as u64) * 9 / 8 + 1;
        let nodes = blocks.div_ceil(6) + 1;
        blocks * block as u64 + nodes * size_of::<MovingNode>() as u64
    }
}

/// `displacement`, or zero if it is too large or not a number.
pub fn bounded(displacement: Vec3) -> Vec3 {
    // NaN is not below anything
    if displacement.abs().max_element() < MAX_DISPLACEMENT && !displacement.is_nan() {
        displacement
    } else {
        Vec3::ZERO
    }
}
