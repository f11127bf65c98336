//! The tree that every builder ends with: 8-wide nodes over blocks.
//!
//! In whole levels, child `c` of node `i` on one level is node `8 i + c` on the next, and the
//! children of the last level are the blocks themselves: no pointers. One level may be in another
//! order than the one below it (see `upper.rs`): there a table says where the children of node `i`
//! begin. Trees of any other shape have a link for each node (see `topology.rs`).
//!
//! With one radius for all, boxes bound the centres and the radius is added per ray; with radii of
//! their own, boxes hold the spheres.

use glam::Vec3;
use rayon::prelude::*;

use super::simd::{SimdLevel, Supported};
use super::topology::Link;
use super::{Aabb, BuildReport, Phase, Structure};
use spherule_formats::blocks::{BLOCK_SIZE, Block, BlockRadii};
use spherule_formats::blocks::{Node, WIDTH};

/// Node levels at most. Whole levels need ten: 8^10 blocks of 16 are more particles than 32 bits
/// count. Builders of other shapes keep to it by balancing what would grow deeper.
pub(super) const MAX_LEVELS: usize = 12;

/// The order of the levels above subtrees of about a thousand particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UpperLevels {
    /// That of the particles.
    InOrder,
    /// One of their own, where that of the particles makes no compact nodes (see `upper.rs`).
    Mapped,
}

/// A tree over spheres. See [`WideTree::nearest`] and its neighbours.
#[derive(Debug, Default)]
pub struct WideTree {
    pub(super) nodes: Vec<Node>,
    /// Number of the first node of each level in `nodes`, root level first.
    pub(super) level_starts: Vec<u32>,
    /// The level whose nodes are in another order than their children; none if beyond all levels.
    pub(super) mapped_level: u32,
    /// For each node of that level, the node whose place its children have.
    pub(super) mapped: Vec<u32>,
    /// Where the children of each node are; empty if levels are whole.
    pub(super) links: Vec<Link>,
    pub(super) blocks: Vec<Block>,
    /// Empty when the radius is common.
    pub(super) radii: Vec<BlockRadii>,
    /// The common radius, or 0.
    pub(super) radius: f32,
    /// Distance that rays pass outside the boxes of nodes and still meet spheres: the radius where
    /// boxes bound centres, 0 where they bound spheres.
    pub(super) padding: f32,
    /// Whether a particle may lie in several slots (a sphere in several leaves, or the last one of
    /// a block repeated to fill it). Only with indices.
    pub(super) has_copies: bool,
    /// Whether boxes bound parts of spheres, which only together cover them.
    pub(super) is_clipped: bool,
    /// Index in the frame of the particle in each lane; empty when not kept.
    pub(super) indices: Vec<u32>,
    pub(super) count: usize,
    pub(super) bounds: Aabb,
    pub(super) simd: Supported,
}

impl WideTree {
    /// Box of the spheres; empty without particles.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Particles.
    pub fn len(&self) -> usize {
        self.count
    }

    /// True if there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The instruction set that rays are traced with.
    pub fn simd(&self) -> SimdLevel {
        self.simd.level()
    }

    /// Traces with `level` from now on, or with the best the machine has if it lacks that.
    pub fn set_simd(&mut self, level: SimdLevel) {
        self.simd = Supported::or_best(level);
    }

    /// Number of the first child of node `index` on `level`, among the nodes (or blocks) below.
    #[inline(always)]
    pub(super) fn first_child(&self, level: u32, index: usize) -> usize {
        if level == self.mapped_level {
            self.mapped[index] as usize * WIDTH
        } else {
            index * WIDTH
        }
    }

    /// Slots that hold particles to be told apart: all, or those before the last block's padding.
    pub(super) fn slot_count(&self) -> usize {
        if self.has_copies {
            self.blocks.len() * BLOCK_SIZE
        } else {
            self.count
        }
    }

    /// Lanes in use. Where there may be copies, those that fill a block up repeat its last particle,
    /// and before them no particle is in a block twice.
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

    /// Index in the frame of the particle in `slot` (tree order), or the slot itself when the way
    /// back was not kept.
    pub fn particle(&self, slot: u32) -> u32 {
        self.indices.get(slot as usize).copied().unwrap_or(slot)
    }

    /// Centre and radius of the particle in `slot`.
    pub fn sphere(&self, slot: u32) -> (Vec3, f32) {
        let (block, lane) = (slot as usize / BLOCK_SIZE, slot as usize % BLOCK_SIZE);
        let radius = self.radii.get(block).map_or(self.radius, |r| r.0[lane]);
        (self.blocks[block].center(lane), radius)
    }

    /// Makes room for `count` particles; what was there is gone, memory stays.
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

    /// Makes room for `blocks` that may hold particles several times.
    pub(super) fn make_room_for_copies(&mut self, blocks: usize) {
        self.has_copies = blocks > 0;
        self.blocks.resize(blocks, bytemuck::Zeroable::zeroed());
        if !self.radii.is_empty() {
            self.radii.resize(blocks, bytemuck::Zeroable::zeroed());
        }
        self.indices.resize(blocks * BLOCK_SIZE, 0);
    }

    /// The memory of the blocks as plain points, and the indices: what builders sort in.
    pub(super) fn points_mut(&mut self) -> (&mut [Vec3], &mut [u32]) {
        (
            bytemuck::cast_slice_mut(&mut self.blocks),
            &mut self.indices,
        )
    }

    /// Brings the radii of the frame into tree order, by the indices.
    pub(super) fn gather_radii(&mut self, radii: &[f32]) {
        self.radii
            .par_iter_mut()
            .zip(self.indices.par_chunks(BLOCK_SIZE))
            .for_each(|(block, indices)| {
                for (radius, index) in block.0.iter_mut().zip(indices) {
                    *radius = radii[*index as usize];
                }
            });
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

    /// Turns sorted points into blocks and builds all levels over them. Returns the SAH cost.
    pub(super) fn finish(&mut self, upper: UpperLevels) -> f64 {
        self.blocks
            .par_iter_mut()
            .with_min_len(256)
            .for_each(Block::transpose_points);
        let counts = level_counts(self.blocks.len());
        self.level_starts.clear();
        let mut total = 0_usize;
        for count in &counts {
            self.level_starts
                .push(spherule_formats::order::index_u32(total));
            total += count;
        }
        self.nodes.resize(total, bytemuck::Zeroable::zeroed());
        let mapped_level = match upper {
            UpperLevels::InOrder => None,
            UpperLevels::Mapped => mapped_level(counts.len()),
        };
        self.mapped_level = mapped_level.map_or(u32::MAX, spherule_formats::order::index_u32);
        self.mapped.clear();
        let (mut boxes, mut areas) = (Vec::new(), 0.0);
        let mut rest = &mut self.nodes[..];
        for (depth, count) in counts.iter().enumerate().rev() {
            let (upper, level) = rest.split_at_mut(rest.len() - count);
            rest = upper;
            let below = std::mem::take(&mut boxes);
            let children = if depth + 1 == counts.len() {
                Children::Blocks(&self.blocks, &self.radii)
            } else {
                Children::Nodes(&below)
            };
            let (level_boxes, child_areas) = build_level(level, &children, self.padding);
            boxes = level_boxes;
            areas += child_areas;
            if Some(depth) == mapped_level {
                self.mapped = super::upper::kd_order(&boxes);
                bring_into_order(level, &mut boxes, &self.mapped);
            }
        }
        self.bounds = match boxes.first() {
            Some(root) => root.padded(self.padding).rounded_outwards(),
            None => Aabb::EMPTY,
        };
        sah_cost(areas, self.bounds)
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
        // Sorting happens in the memory of the result and what the builder says; later there are
        // the boxes of the lowest level.
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
            depth: spherule_formats::order::index_u32(self.level_starts.len()),
            sah_cost,
            position_bytes,
            structure_bytes,
            peak_bytes: position_bytes + structure_bytes + boxes.max(sort_bytes),
            simd: self.simd().name(),
        }
    }
}

/// Expected tests of a ray that meets the `root` box, over children whose areas are summed up.
pub(super) fn sah_cost(child_areas: f64, root: Aabb) -> f64 {
    let root_area = root.area();
    if root_area > 0.0 {
        1.0 + child_areas / root_area
    } else {
        1.0
    }
}

/// Levels of nodes that stay in the order of the particles: subtrees of 8 * 8 blocks.
const LOWER_LEVELS: usize = 2;

/// The level of the roots of those subtrees, if there are levels above it to gain by another order.
fn mapped_level(levels: usize) -> Option<usize> {
    levels.checked_sub(LOWER_LEVELS).filter(|level| *level > 0)
}

/// Puts the nodes of a level and their boxes into `order`.
fn bring_into_order(level: &mut [Node], boxes: &mut Vec<Aabb>, order: &[u32]) {
    let old = level.to_vec();
    for (node, place) in level.iter_mut().zip(order) {
        *node = old[*place as usize];
    }
    *boxes = order.iter().map(|place| boxes[*place as usize]).collect();
}

/// What the nodes of a level enclose.
enum Children<'a> {
    Blocks(&'a [Block], &'a [BlockRadii]),
    Nodes(&'a [Aabb]),
}

impl Children<'_> {
    fn bounds(&self, index: usize) -> Option<Aabb> {
        match self {
            Self::Blocks(blocks, radii) => {
                let block = blocks.get(index)?;
                Some(match radii.get(index) {
                    Some(radii) => block.sphere_bounds(radii),
                    None => block.bounds(),
                })
            }
            Self::Nodes(boxes) => boxes.get(index).copied(),
        }
    }
}

/// Nodes of each level, root level first; empty without blocks.
fn level_counts(blocks: usize) -> Vec<usize> {
    let mut counts = Vec::new();
    let mut count = blocks;
    while count > 1 || (count == 1 && counts.is_empty()) {
        count = count.div_ceil(WIDTH);
        counts.push(count);
    }
    counts.reverse();
    counts
}

/// Fills `level`; returns the box of each node and the summed area of the children.
fn build_level(level: &mut [Node], children: &Children, radius: f32) -> (Vec<Aabb>, f64) {
    // Areas are summed by runs of a fixed length, so that the sum does not depend on the threads.
    const RUN: usize = 1024;
    let mut boxes = vec![Aabb::EMPTY; level.len()];
    let areas: Vec<f64> = level
        .par_chunks_mut(RUN)
        .zip(boxes.par_chunks_mut(RUN))
        .enumerate()
        .map(|(run, (nodes, boxes))| {
            let mut area = 0.0;
            for (offset, (node, own)) in nodes.iter_mut().zip(boxes).enumerate() {
                let first = (run * RUN + offset) * WIDTH;
                let mut bounds = [Aabb::EMPTY; WIDTH];
                let mut used = 0;
                while let Some(child) = (used < WIDTH)
                    .then(|| children.bounds(first + used))
                    .flatten()
                {
                    area += child.padded(radius).area();
                    *own = own.union(child);
                    bounds[used] = child;
                    used += 1;
                }
                *node = Node::enclosing(&bounds[..used]);
            }
            area
        })
        .collect();
    (boxes, areas.iter().sum())
}
