//! The tree that every builder produces: 8-wide nodes over blocks.
//!
//! In complete levels, child `c` of node `i` on one level is node `8 i + c` on the next, and the children of the last
//! level are the blocks: there are no pointers. One level may have an order that differs from the level below it (see
//! `top_levels.rs`); a table then gives the position of the first child of node `i`. Trees of any other shape have a
//! link for each node (see `topology.rs`).
//!
//! With a common radius, boxes bound the centres and the tests of a ray add the radius. With a radius per particle,
//! boxes bound the spheres.

use glam::Vec3;
use rayon::prelude::*;

use super::levels::{Child, TopLevels, build_levels, level_counts, level_starts, sah_cost};
use super::simd::{SimdLevel, Supported};
use super::topology::LEVEL_CODES;
use super::topology::Link;
use super::view::{TieOrder, TreeView, split_levels};
use super::{Aabb, BuildReport, Phase, Structure};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii, Node, StoredBlocks, StoredRadii, WIDTH};
use crate::order::index_u32;

/// A tree over spheres that owns all of its memory. Rays use its [`WideTree::view`].
#[derive(Debug, Default)]
pub struct WideTree {
    pub(super) nodes: Vec<Node>,
    /// Index of the first node of each level in `nodes`, root level first.
    pub(super) level_starts: Vec<u32>,
    /// The level with a node order that differs from the order of the children; beyond all levels if there is none.
    pub(super) mapped_level: u32,
    /// For each node of that level, an index; its children begin at 8 times this index on the next level.
    pub(super) mapped: Vec<u32>,
    /// Positions of the children of each node; empty for complete levels.
    pub(super) links: Vec<Link>,
    pub(super) blocks: Vec<Block>,
    /// Empty if there is a common radius.
    pub(super) radii: Vec<BlockRadii>,
    /// The common radius, or 0.
    pub(super) radius: f32,
    /// Length by which the boxes of nodes must be extended: the radius if boxes bound centres, 0 if they bound spheres.
    pub(super) padding: f32,
    /// Whether a particle may be stored in several slots (a sphere in several leaves, or the last one of a block
    /// repeated as padding). Only with indices.
    pub(super) has_copies: bool,
    /// Whether boxes bound parts of spheres, which cover the spheres only together.
    pub(super) is_clipped: bool,
    /// Index in the frame of the particle in each lane; empty if indices are not kept.
    pub(super) indices: Vec<u32>,
    pub(super) count: usize,
    pub(super) bounds: Aabb,
    pub(super) simd: Supported,
}

impl WideTree {
    /// The tree in the form that rays use.
    pub fn view(&self) -> TreeView<'_> {
        let mut levels: [&[Node]; LEVEL_CODES] = [&[]; LEVEL_CODES];
        if self.links.is_empty() {
            split_levels(&self.nodes, &self.level_starts, &mut levels);
        } else {
            levels[0] = &self.nodes;
        }
        TreeView {
            levels,
            depth: index_u32(self.level_starts.len()),
            mapped_level: self.mapped_level,
            mapped: &self.mapped,
            links: &self.links,
            blocks: StoredBlocks::F32(&self.blocks),
            radii: if self.radii.is_empty() {
                StoredRadii::None
            } else {
                StoredRadii::F32(&self.radii)
            },
            radius: self.radius,
            padding: self.padding,
            has_copies: self.has_copies,
            indices: &self.indices,
            ties: if self.indices.is_empty() { TieOrder::Center } else { TieOrder::Index },
            count: self.count,
            bounds: self.bounds,
            simd: self.simd,
        }
    }

    /// The instruction set that rays are traced with.
    pub fn simd(&self) -> SimdLevel {
        self.simd.level()
    }

    /// Traces with `level` from now on, or with the best instruction set of the machine if `level` is not supported.
    pub fn set_simd(&mut self, level: SimdLevel) {
        self.simd = Supported::or_best(level);
    }

    /// Number of lanes in use. If there may be copies, the padding of a block repeats its last particle, and all
    /// particles before it are distinct.
    fn reference_count(&self) -> u64 {
        if !self.has_copies {
            return self.count as u64;
        }
        let used = |block: &[u32]| {
            let last = block[BLOCK_SIZE - 1];
            let repeated = block.iter().rev().take_while(|index| **index == last);
            BLOCK_SIZE + 1 - repeated.count()
        };
        let blocks = self.indices.par_chunks_exact(BLOCK_SIZE);
        blocks.map(|block| used(block) as u64).sum()
    }

    /// Resizes for `count` particles. The content is replaced, allocated memory is kept.
    pub(super) fn reset(&mut self, count: usize, radius: Option<f32>, indexed: bool) {
        let blocks = count.div_ceil(BLOCK_SIZE);
        self.count = count;
        self.radius = radius.unwrap_or(0.0);
        self.padding = self.radius;
        self.has_copies = false;
        self.is_clipped = false;
        self.links.clear();
        self.blocks.resize(blocks, bytemuck::Zeroable::zeroed());
        self.radii.clear();
        if radius.is_none() {
            self.radii.resize(blocks, bytemuck::Zeroable::zeroed());
        }
        let lanes = if indexed { blocks * BLOCK_SIZE } else { 0 };
        self.indices.resize(lanes, 0);
    }

    /// Resizes for `blocks` blocks that may store particles several times.
    pub(super) fn resize_with_copies(&mut self, blocks: usize) {
        self.has_copies = blocks > 0;
        self.blocks.resize(blocks, bytemuck::Zeroable::zeroed());
        if !self.radii.is_empty() {
            self.radii.resize(blocks, bytemuck::Zeroable::zeroed());
        }
        self.indices.resize(blocks * BLOCK_SIZE, 0);
    }

    /// The memory of the blocks as plain points, and the indices, for builders that sort in place.
    pub(super) fn points_mut(&mut self) -> (&mut [Vec3], &mut [u32]) {
        (bytemuck::cast_slice_mut(&mut self.blocks), &mut self.indices)
    }

    /// Copies the radii of the frame in tree order, by the indices.
    pub(super) fn gather_radii(&mut self, radii: &[f32]) {
        self.radii.par_iter_mut().zip(self.indices.par_chunks(BLOCK_SIZE)).for_each(
            |(block, indices)| {
                for (radius, index) in block.0.iter_mut().zip(indices) {
                    *radius = radii[*index as usize];
                }
            },
        );
    }

    pub(super) fn drop_indices(&mut self) {
        self.indices = Vec::new();
    }

    /// Fills the unused lanes of the last block with its last particle, so that they never add a hit.
    pub(super) fn pad_last_block(&mut self) {
        let count = self.count;
        let (points, indices) = self.points_mut();
        if let Some(last) = count.checked_sub(1) {
            let point = points[last];
            points[count..].fill(point);
            if !indices.is_empty() {
                let index = indices[last];
                indices[count..].fill(index);
            }
        }
    }

    /// Converts sorted points to blocks and builds all levels over them. Returns the SAH cost.
    pub(super) fn finish(&mut self, upper: TopLevels) -> f64 {
        self.blocks.par_iter_mut().with_min_len(256).for_each(Block::transpose_points);
        // Size the levels
        let counts = level_counts(self.blocks.len());
        self.level_starts = level_starts(&counts);
        self.nodes.resize(counts.iter().sum(), bytemuck::Zeroable::zeroed());
        let mapped_level = upper.mapped_level(counts.len());
        self.mapped_level = mapped_level.map_or(u32::MAX, index_u32);
        // Build the levels over the boxes of the blocks
        let (blocks, radii) = (&self.blocks, &self.radii);
        let child = |index: usize| {
            let block = blocks.get(index)?;
            Some(Child {
                bounds: match radii.get(index) {
                    Some(radii) => block.sphere_bounds(radii),
                    None => block.bounds(),
                },
                inner_area: 0.0,
            })
        };
        let nodes = &mut self.nodes[..];
        let built = build_levels(nodes, &counts, mapped_level, self.padding, child);
        self.mapped = built.mapped;
        self.bounds = if blocks.is_empty() {
            Aabb::EMPTY
        } else {
            built.bounds.padded(self.padding).rounded_outwards()
        };
        sah_cost(built.child_areas, self.bounds)
    }

    /// The report of the build that just ended.
    pub(super) fn report(
        &self,
        structure: Structure,
        order: &'static str,
        sah_cost: f64,
        sort_bytes: u64,
        phases: Vec<Phase>,
    ) -> BuildReport {
        let position_bytes =
            size_of_val(&self.blocks[..]) as u64 + size_of_val(&self.radii[..]) as u64;
        let structure_bytes = size_of_val(&self.nodes[..]) as u64
            + size_of_val(&self.mapped[..]) as u64
            + size_of_val(&self.links[..]) as u64
            + size_of_val(&self.indices[..]) as u64;
        // The sort uses the memory of the result and the scratch memory of the builder; later the boxes of the lowest
        // level are needed.
        let boxes = self.blocks.len().div_ceil(WIDTH) as u64 * size_of::<Aabb>() as u64;
        BuildReport {
            structure,
            order,
            total: phases.iter().map(|p| p.time).sum(),
            phases,
            particles: self.count as u64,
            references: self.reference_count(),
            nodes: self.nodes.len() as u64,
            leaves: self.blocks.len() as u64,
            depth: index_u32(self.level_starts.len()),
            sah_cost,
            position_bytes,
            structure_bytes,
            file_bytes: 0,
            peak_bytes: position_bytes + structure_bytes + boxes.max(sort_bytes),
            simd: self.simd().name(),
        }
    }
}
