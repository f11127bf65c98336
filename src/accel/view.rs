//! A tree as rays see it: slices, wherever they lie. Built trees ([`super::wide::WideTree`]) give a view
//! of what they own, stored ones ([`super::stored::StoredTree`]) of what they own and of a frame's leaves.

use std::cmp::Ordering;

use glam::Vec3;

use super::Aabb;
use super::hits::TreeHits;
use super::leaves::{Coded, Exact, Leaves};
use super::simd::{KernelTask, PacketKernel, RunTask, SimdLevel, Supported};
use super::topology::{Implicit, LEVEL_CODES, Link, Linked, Topology};
use crate::math::{LANES, Lanes, Lanes3, lanes_in, set_lane3};
use spherule_formats::blocks::{BLOCK_SIZE, Node, StoredBlocks, StoredRadii};

/// A tree over spheres, to be traced. See [`TreeView::nearest`] and its neighbours.
#[derive(Debug, Clone, Copy)]
pub struct TreeView<'a> {
    /// Nodes of each level, root level first; all of them in the first where there are links.
    pub(super) levels: [&'a [Node]; LEVEL_CODES],
    /// Levels of nodes.
    pub(super) depth: u32,
    /// The level whose nodes are in another order than their children; none if beyond all levels.
    pub(super) mapped_level: u32,
    /// For each node of that level, the node whose place its children have.
    pub(super) mapped: &'a [u32],
    /// Where the children of each node are; empty if levels are whole. Then leaves are exact.
    pub(super) links: &'a [Link],
    /// Positions.
    pub(super) blocks: StoredBlocks<'a>,
    /// Radii, unless common.
    pub(super) radii: StoredRadii<'a>,
    /// The common radius, or 0.
    pub(super) radius: f32,
    /// Distance that rays pass outside the boxes of nodes and still meet spheres: the radius where
    /// boxes bound centres, 0 where they bound spheres.
    pub(super) padding: f32,
    /// Whether a particle may lie in several slots. Only with indices.
    pub(super) has_copies: bool,
    /// Index in the frame of the particle in each slot; if empty, the slot is the index, or nobody asks.
    pub(super) indices: &'a [u32],
    /// Who comes first at equal distance.
    pub(super) ties: TieOrder,
    /// Particles.
    pub(super) count: usize,
    /// Box of the spheres.
    pub(super) bounds: Aabb,
    pub(super) simd: Supported,
}

/// Block and lane of a slot.
#[inline(always)]
fn place_of(slot: u32) -> (usize, usize) {
    (slot as usize / BLOCK_SIZE, slot as usize % BLOCK_SIZE)
}

/// Who comes first of two particles at equal distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TieOrder {
    /// The lower index in the frame.
    #[default]
    Index,
    /// The lower centre, where indices are not known: so that it never depends on the structure.
    Center,
}

impl<'a> TreeView<'a> {
    /// Whole levels; only of a tree without links.
    pub(super) fn implicit(&'a self) -> Implicit<'a> {
        Implicit {
            levels: &self.levels,
            depth: self.depth,
            mapped_level: self.mapped_level,
            mapped: self.mapped,
        }
    }

    /// Any shape; only of a tree with links.
    pub(super) fn linked(&self) -> Linked<'a> {
        Linked {
            nodes: self.levels[0],
            links: self.links,
        }
    }

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

    /// Index in the frame of the particle in `slot` (tree order), or the slot itself when the way
    /// back was not kept.
    pub fn particle(&self, slot: u32) -> u32 {
        match self.indices.get(slot as usize) {
            Some(index) => *index,
            None => self.existing(slot),
        }
    }

    /// `slot`, or the last one that holds a particle: what fills the last block of a damaged file up need
    /// not repeat its last particle, and may be hit.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "slots are counted in 32 bits"
    )]
    fn existing(&self, slot: u32) -> u32 {
        slot.min(self.count.saturating_sub(1) as u32)
    }

    /// Centre and radius of the particle in `slot`.
    ///
    /// # Panics
    /// If there is no such slot.
    pub fn sphere(&self, slot: u32) -> (Vec3, f32) {
        let (block, lane) = place_of(slot);
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

    /// Centres and radii of the spheres in the slots of `lanes`.
    ///
    /// # Panics
    /// If there is no such slot.
    pub(crate) fn gather_spheres(
        &self,
        hits: &TreeHits,
        lanes: u32,
        centers: &mut Lanes3,
        radii: &mut Lanes,
    ) {
        if let (StoredBlocks::F32(blocks), StoredRadii::None) = (self.blocks, self.radii) {
            *radii = [self.radius; LANES];
            for lane in lanes_in(lanes) {
                let (block, place) = place_of(hits.slot[lane]);
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

    /// Whether a particle may be met in several slots, so that [`TreeView::visit_crossings`] brings the
    /// same crossing several times.
    pub(crate) fn has_copies(&self) -> bool {
        self.has_copies
    }

    /// Slots that hold particles to be told apart: all, or those before the last block's padding.
    pub(super) fn slot_count(&self) -> usize {
        if self.has_copies {
            self.indices.len()
        } else {
            self.count
        }
    }

    /// Nodes over the blocks, in a tree of whole levels.
    pub(super) fn leaf_nodes(&self) -> &'a [Node] {
        match self.depth {
            0 => &[],
            depth => self.levels[depth as usize - 1],
        }
    }

    /// Who comes first of two particles hit at the same distance. Equal ones go by slot, so that it
    /// does not depend on the order of visits either.
    #[cold]
    pub(super) fn tie_order(&self, a: u32, b: u32) -> Ordering {
        if self.ties == TieOrder::Index {
            return self.particle(a).cmp(&self.particle(b)).then(a.cmp(&b));
        }
        let center = |slot| self.sphere(slot).0;
        let (p, q) = (center(a), center(b));
        p.x.total_cmp(&q.x)
            .then(p.y.total_cmp(&q.y))
            .then(p.z.total_cmp(&q.z))
            .then(a.cmp(&b))
    }

    /// Does `task` in code made for the tree's shape, its leaves and the machine.
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
        let tree = Resolved {
            view: self,
            topology,
            leaves,
        };
        self.simd.run(InTree { tree, task })
    }
}

/// Puts the levels of `nodes`, of which the first nodes have the numbers `starts`, into `levels`.
pub(super) fn split_levels<'a>(
    nodes: &'a [Node],
    starts: &[u32],
    levels: &mut [&'a [Node]; LEVEL_CODES],
) {
    let ends = starts.iter().skip(1).map(|start| *start as usize);
    let ends = ends.chain([nodes.len()]);
    for (level, (start, end)) in levels.iter_mut().zip(starts.iter().zip(ends)) {
        *level = &nodes[*start as usize..end];
    }
}

/// A tree of which the compiler knows the shape and the leaves.
#[derive(Clone, Copy)]
pub(super) struct Resolved<'a, T, L> {
    pub(super) view: &'a TreeView<'a>,
    pub(super) topology: T,
    pub(super) leaves: L,
}

/// Something to be done with a tree, compiled for each shape, form of leaves and kernel. `run` should be
/// `inline(always)`.
pub(super) trait TreeTask {
    /// What comes of it.
    type Output;

    /// Does it.
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
