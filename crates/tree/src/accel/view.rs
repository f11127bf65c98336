//! A tree in the form that rays use: slices of memory that others own. A built tree ([`super::wide::WideTree`]) gives
//! a view of its own memory, a stored one ([`super::stored::StoredTree`]) of its own memory and the leaves of a
//! frame.

use std::cmp::Ordering;

use glam::Vec3;

use super::Aabb;
use super::hits::TreeHits;
use super::leaves::{Coded, Exact, Leaves};
use super::simd::{KernelTask, PacketKernel, RunTask, SimdLevel, Supported};
use super::topology::{Implicit, LEVEL_CODES, Link, Linked, Topology};
use crate::blocks::{BLOCK_SIZE, Node, StoredBlocks, StoredRadii};
use crate::math::{LANES, Lanes, Lanes3, lanes_in, set_lane3};

/// A tree over spheres for ray queries, see [`TreeView::nearest`] and the methods like it.
#[derive(Debug, Clone, Copy)]
pub struct TreeView<'a> {
    /// Nodes of each level, root level first. A tree with links has all nodes in the first element.
    pub(super) levels: [&'a [Node]; LEVEL_CODES],
    /// Number of node levels.
    pub(super) depth: u32,
    /// The level with a node order that differs from the order of the children; beyond all levels if there is none.
    pub(super) mapped_level: u32,
    /// For each node of that level, an index; its children begin at 8 times this index on the next level.
    pub(super) mapped: &'a [u32],
    /// Positions of the children of each node; empty for complete levels. A tree with links has uncoded leaves.
    pub(super) links: &'a [Link],
    /// Positions.
    pub(super) blocks: StoredBlocks<'a>,
    /// Radii, unless there is a common radius.
    pub(super) radii: StoredRadii<'a>,
    /// The common radius, or 0.
    pub(super) radius: f32,
    /// Length by which the boxes of nodes must be extended: the radius if boxes bound centres, 0 if they bound spheres.
    pub(super) padding: f32,
    /// Whether a particle may be stored in several slots. Only with indices.
    pub(super) has_copies: bool,
    /// Index in the frame of the particle in each slot. If empty, the slot is the index, or indices are not needed.
    pub(super) indices: &'a [u32],
    /// Order of particles at equal distance.
    pub(super) ties: TieOrder,
    /// Particle count.
    pub(super) count: usize,
    /// Bounding box of the spheres.
    pub(super) bounds: Aabb,
    pub(super) simd: Supported,
}

/// Block and lane of a slot.
#[inline(always)]
fn block_and_lane(slot: u32) -> (usize, usize) {
    (slot as usize / BLOCK_SIZE, slot as usize % BLOCK_SIZE)
}

/// Order of two particles at equal distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TieOrder {
    /// The lower index in the frame comes first.
    #[default]
    Index,
    /// The lower centre comes first. Used without indices, so that the order does not depend on the structure.
    Center,
}

impl<'a> TreeView<'a> {
    /// The topology of complete levels; only for trees without links.
    pub(super) fn implicit(&'a self) -> Implicit<'a> {
        Implicit {
            levels: &self.levels,
            depth: self.depth,
            mapped_level: self.mapped_level,
            mapped: self.mapped,
        }
    }

    /// The topology of links; only for trees with links.
    pub(super) fn linked(&self) -> Linked<'a> {
        Linked { nodes: self.levels[0], links: self.links }
    }

    /// Bounding box of the spheres; empty without particles.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Particle count.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The instruction set that rays are traced with.
    pub fn simd(&self) -> SimdLevel {
        self.simd.level()
    }

    /// Index in the frame of the particle in `slot` (tree order), or the slot itself if indices were not kept.
    pub fn particle(&self, slot: u32) -> u32 {
        match self.indices.get(slot as usize) {
            Some(index) => *index,
            None => self.clamped_slot(slot),
        }
    }

    /// `slot`, or the last slot with a particle. In a damaged file, the padding of the last block need not repeat the
    /// last particle, so rays may hit it.
    #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
    fn clamped_slot(&self, slot: u32) -> u32 {
        slot.min(self.count.saturating_sub(1) as u32)
    }

    /// Centre and radius of the particle in `slot`.
    ///
    /// # Panics
    /// If the slot does not exist.
    pub fn sphere(&self, slot: u32) -> (Vec3, f32) {
        let (block, lane) = block_and_lane(slot);
        let center = match self.blocks {
            StoredBlocks::F32(blocks) => blocks[block].center(lane),
            StoredBlocks::Q16(blocks) => Coded::new(blocks, self.leaf_nodes()).center(block, lane),
            StoredBlocks::Q10(blocks) => Coded::new(blocks, self.leaf_nodes()).center(block, lane),
        };
        let radius = match self.radii {
            StoredRadii::None => self.radius,
            StoredRadii::F32(radii) => radii[block].0[lane],
            StoredRadii::U16 { codes, low, step } => low + f32::from(codes[block][lane]) * step,
            StoredRadii::U8 { codes, low, step } => low + f32::from(codes[block][lane]) * step,
        };
        (center, radius)
    }

    /// Centres and radii of the spheres hit in `lanes`.
    ///
    /// # Panics
    /// If a slot does not exist.
    pub fn gather_spheres(
        &self,
        hits: &TreeHits,
        lanes: u32,
        centers: &mut Lanes3,
        radii: &mut Lanes,
    ) {
        // Common case: uncoded positions and one radius
        if let (StoredBlocks::F32(blocks), StoredRadii::None) = (self.blocks, self.radii) {
            *radii = [self.radius; LANES];
            for lane in lanes_in(lanes) {
                let (block, place) = block_and_lane(hits.slot[lane]);
                set_lane3(centers, lane, blocks[block].center(place));
            }
            return;
        }
        for lane in lanes_in(lanes) {
            let (center, radius) = self.sphere(hits.slot[lane]);
            set_lane3(centers, lane, center);
            radii[lane] = radius;
        }
    }

    /// Whether a particle may be stored in several slots, so that [`TreeView::visit_crossings`] may visit the same
    /// crossing several times.
    pub fn has_copies(&self) -> bool {
        self.has_copies
    }

    /// Number of slots in use: all, or those before the padding of the last block.
    pub(super) fn slot_count(&self) -> usize {
        if self.has_copies { self.indices.len() } else { self.count }
    }

    /// Nodes above the blocks, in a tree of complete levels.
    pub(super) fn leaf_nodes(&self) -> &'a [Node] {
        match self.depth {
            0 => &[],
            depth => self.levels[depth as usize - 1],
        }
    }

    /// Order of two particles hit at the same distance. Equal particles are ordered by slot, so that the order does
    /// not depend on the traversal.
    #[cold]
    pub(super) fn tie_order(&self, a: u32, b: u32) -> Ordering {
        if self.ties == TieOrder::Index {
            return self.particle(a).cmp(&self.particle(b)).then(a.cmp(&b));
        }
        let center = |slot| self.sphere(slot).0;
        let (p, q) = (center(a), center(b));
        p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z)).then(a.cmp(&b))
    }

    /// Runs `task` in code compiled for the topology, the leaves and the instruction set.
    #[inline]
    pub(super) fn run<W: TreeTask>(&self, task: W) -> W::Output {
        match self.blocks {
            StoredBlocks::F32(blocks) if self.links.is_empty() => {
                self.run_in(self.implicit(), Exact(blocks), task)
            }
            StoredBlocks::F32(blocks) => self.run_in(self.linked(), Exact(blocks), task),
            StoredBlocks::Q16(blocks) => {
                let leaves = Coded::new(blocks, self.leaf_nodes());
                self.run_in(self.implicit(), leaves, task)
            }
            StoredBlocks::Q10(blocks) => {
                let leaves = Coded::new(blocks, self.leaf_nodes());
                self.run_in(self.implicit(), leaves, task)
            }
        }
    }

    #[inline]
    fn run_in<'v, T: Topology<'v>, L: Leaves, W: TreeTask>(
        &'v self,
        topology: T,
        leaves: L,
        task: W,
    ) -> W::Output {
        let tree = Resolved { view: self, topology, leaves };
        self.simd.run(InTree { tree, task })
    }
}

/// Splits `nodes` into `levels`; `starts` are the indices of their first nodes.
pub(super) fn split_levels<'a>(
    nodes: &'a [Node],
    starts: &[u32],
    levels: &mut [&'a [Node]; LEVEL_CODES],
) {
    let ends = starts.iter().skip(1).map(|start| *start as usize).chain([nodes.len()]);
    for (level, (start, end)) in levels.iter_mut().zip(starts.iter().zip(ends)) {
        *level = &nodes[*start as usize..end];
    }
}

/// A tree with topology and leaves of static types.
#[derive(Clone, Copy)]
pub(super) struct Resolved<'a, T, L> {
    pub(super) view: &'a TreeView<'a>,
    pub(super) topology: T,
    pub(super) leaves: L,
}

/// Code that uses a tree, compiled for each topology, kind of leaves and kernel. `run` should be `inline(always)`.
pub(super) trait TreeTask {
    /// The result.
    type Output;

    /// Runs the task.
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> Self::Output;
}

/// A task with its tree.
struct InTree<'a, T, L, W> {
    tree: Resolved<'a, T, L>,
    task: W,
}

impl<'a, T: Topology<'a>, L: Leaves, W: TreeTask> KernelTask for InTree<'a, T, L, W> {
    type Output = W::Output;

    #[inline(always)]
    fn run<K: PacketKernel>(self, kernel: K) -> W::Output {
        self.task.run(kernel, self.tree)
    }
}
