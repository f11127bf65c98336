//! The union of the spheres of a tree along a ray: where the ray enters it, and where it leaves it.
//!
//! Each sphere covers an interval of the ray. The union around the start of the ray ends where the last of a chain of
//! overlapping intervals ends. Intervals are collected from the front: an interval that begins before the current end
//! may extend it. Intervals that end before the current end are skipped, so a ray visits only the part of a deep body
//! that it crosses. The result depends only on the intervals, not on the order in which they are found, nor on
//! duplicates.

use std::borrow::Borrow;
use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::Vec3;

use super::leaves::{Leaves, LoadedRadii};
use super::simd::{BlockCrossings, PacketKernel};
use super::topology::{NodeRef, Topology};
use super::traverse::TreeHit;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::{STACK_SIZE, walk};
use crate::blocks::BLOCK_SIZE;
use crate::ray::Ray;

/// Where a ray that starts inside spheres leaves their union.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TreeExit {
    /// At the surface of this sphere, the last one.
    Here(TreeHit),
    /// Not before `ray.t_max`.
    Beyond,
    /// The ray does not start inside a sphere.
    NotInside,
}

impl TreeView<'_> {
    /// Where a ray that starts outside all spheres enters the first one, within `ray.t_min..ray.t_max`. Ties in
    /// distance go to the lower particle index. If a ray starts inside a sphere nevertheless, it enters the sphere at
    /// `ray.t_min` if it is in the first half of the chord, and ignores the sphere otherwise.
    pub fn entry(&self, ray: &Ray) -> Option<TreeHit> {
        if !self.may_intersect(ray) {
            return None;
        }
        self.run(Entry { ray })
    }

    /// Where a ray that is inside spheres at `ray.t_min` leaves their union. If several spheres end there, the result
    /// is the one with the lowest particle index.
    pub fn exit(&self, ray: &Ray) -> TreeExit {
        thread_local! {
            /// The rays of a thread are traced one after another, so they share one buffer.
            static DEFERRED: RefCell<DeferredQueue> = const { RefCell::new(DeferredQueue::new()) };
        }
        DEFERRED.with_borrow_mut(|deferred| {
            deferred.clear();
            self.run(Exit { ray, deferred })
        })
    }

    /// Whether `point` lies in or on any sphere.
    pub fn contains(&self, point: Vec3) -> bool {
        let bounds = self.bounds;
        if point.cmplt(bounds.min).any() || point.cmpgt(bounds.max).any() {
            return false;
        }
        let ray = Ray { t_max: 0.0, ..Ray::new(point, Vec3::X) };
        self.run(Contains { ray: &ray })
    }
}

/// The lanes that are set in `lanes`, with their slots. Stops at the first slot without a particle.
#[inline(always)]
fn slots_of(block: usize, mut lanes: u32, slots: usize) -> impl Iterator<Item = (usize, u32)> {
    std::iter::from_fn(move || {
        let lane = lanes.trailing_zeros() as usize;
        let slot = block * BLOCK_SIZE + lane;
        if lanes == 0 || slot >= slots {
            return None;
        }
        lanes &= lanes - 1;
        #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
        Some((lane, slot as u32))
    })
}

/// The intervals of the line of `ray` that the spheres of a block cover.
#[inline(always)]
fn intervals<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
    kernel: K,
    tree: &Resolved<'a, T, L>,
    ray: &K::Ray,
    block: usize,
) -> BlockCrossings {
    let centers = tree.leaves.load(kernel, block);
    let radii = LoadedRadii::of(&tree.view.radii, block);
    kernel.all_in_block(ray, centers.borrow(), radii.as_ref())
}

struct Entry<'r> {
    ray: &'r Ray,
}

impl TreeTask for Entry<'_> {
    type Output = Option<TreeHit>;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> Option<TreeHit> {
        let (ray, view) = (self.ray, tree.view);
        let prepared = view.prepare(kernel, ray);
        let slots = view.slot_count();
        let mut best: Option<TreeHit> = None;
        walk(
            kernel,
            tree,
            |node, limit| kernel.test_node(&prepared, node, limit),
            ray.t_max.next_down(),
            |block, mut limit| {
                let found = intervals(kernel, &tree, &prepared, block);
                for (lane, slot) in slots_of(block, found.lanes, slots) {
                    // Skip spheres that do not count as entered
                    let Some(t) = entry_distance(found.near[lane], found.far[lane], ray.t_min)
                    else {
                        continue;
                    };
                    // Keep the nearest entry; break ties by particle order
                    let wins = t < limit
                        || t == limit
                            && best.is_none_or(|held| {
                                t < held.t || view.tie_order(slot, held.slot).is_lt()
                            });
                    if wins {
                        best = Some(TreeHit { t, slot });
                        limit = t;
                    }
                }
                limit
            },
        );
        best
    }
}

/// Where a ray that begins at `t_min` enters a sphere that covers `near..far` of its line. If the ray starts inside
/// the sphere, it counts as entered in the first half of the chord only. A sphere that is only touched has no inside,
/// so an entry is always followed by an exit that is farther along the ray.
#[inline(always)]
fn entry_distance(near: f32, far: f32, t_min: f32) -> Option<f32> {
    if near >= t_min {
        (far > near).then_some(near)
    } else {
        (near + far > 2.0 * t_min).then_some(t_min)
    }
}

struct Contains<'r> {
    /// A ray of length zero.
    ray: &'r Ray,
}

impl TreeTask for Contains<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> bool {
        let view = tree.view;
        let prepared = view.prepare(kernel, self.ray);
        let slots = view.slot_count();
        let mut is_inside = false;
        walk(
            kernel,
            tree,
            |node, limit| kernel.test_node(&prepared, node, limit),
            0.0,
            |block, limit| {
                let found = intervals(kernel, &tree, &prepared, block);
                is_inside = slots_of(block, found.lanes, slots)
                    .any(|(lane, _)| found.near[lane] <= 0.0 && found.far[lane] >= 0.0);
                if is_inside { -1.0 } else { limit }
            },
        );
        is_inside
    }
}

/// Nodes and blocks with intervals that begin beyond the current end, nearest first.
#[derive(Debug)]
struct DeferredQueue(BinaryHeap<Reverse<Deferred>>);

/// A block, or a node with some children still to be visited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Deferred {
    /// In the upper half, the bits of the distance at which its next interval begins, which order like integers
    /// because they are not negative. In the lower half, the code of the node or block.
    key: u64,
    /// Bit mask of the children of a node that have been visited.
    visited: u8,
}

impl DeferredQueue {
    const fn new() -> Self {
        Self(BinaryHeap::new())
    }

    fn clear(&mut self) {
        self.0.clear();
    }

    #[inline(always)]
    fn push(&mut self, distance: u32, code: u32, visited: u8) {
        let key = (u64::from(distance) << 32) | u64::from(code);
        self.0.push(Reverse(Deferred { key, visited }));
    }

    /// The nearest item if it begins no later than `end`: its code and the mask of visited children.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the two halves")]
    fn pop_before(&mut self, end: f32) -> Option<(u32, u8)> {
        let Reverse(Deferred { key, .. }) = self.0.peek()?;
        let begins = f32::from_bits((key >> 32) as u32);
        if begins > end {
            return None;
        }
        let Reverse(Deferred { key, visited }) = self.0.pop()?;
        Some((key as u32, visited))
    }
}

struct Exit<'r> {
    ray: &'r Ray,
    deferred: &'r mut DeferredQueue,
}

/// The end of the union as far as it is known.
struct UnionEnd {
    end: f32,
    /// The sphere that ends there; none before the first interval.
    slot: Option<u32>,
}

impl UnionEnd {
    /// Adds the intervals of a block. Returns the least distance at which an interval of the block begins beyond the
    /// end, or infinity.
    #[inline(always)]
    fn extend(&mut self, view: &TreeView, block: usize, found: &BlockCrossings) -> f32 {
        loop {
            // Extend the end by every interval that begins before it
            let before = self.end;
            let mut next = f32::INFINITY;
            for (lane, slot) in slots_of(block, found.lanes, view.slot_count()) {
                let (near, far) = (found.near[lane], found.far[lane]);
                if near > self.end {
                    next = next.min(near);
                } else if far > self.end || (far == self.end && self.precedes_current(view, slot)) {
                    *self = Self { end: far, slot: Some(slot) };
                }
            }
            // Repeat if the end has moved past the beginning of a skipped interval of the block.
            if self.end == before || next > self.end {
                return next;
            }
        }
    }

    /// Whether `slot`, which ends where the union ends, precedes the current slot.
    fn precedes_current(&self, view: &TreeView, slot: u32) -> bool {
        self.slot.is_none_or(|held| view.tie_order(slot, held).is_lt())
    }
}

impl TreeTask for Exit<'_> {
    type Output = TreeExit;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> TreeExit {
        let Self { ray, deferred } = self;
        let (view, topology) = (tree.view, tree.topology);
        if view.is_empty() {
            return TreeExit::NotInside;
        }
        // Prepare the ray with the current end as `t_min`, so that boxes that lie before it are culled.
        let from = |t_min: f32| view.prepare(kernel, &Ray { t_min, ..*ray });
        let limit = ray.t_max.next_down();
        let mut union = UnionEnd { end: ray.t_min, slot: None };
        let mut prepared = from(union.end);
        // Nodes and blocks that begin before the end; at most the children of one node per level.
        let mut stack = [0_u32; STACK_SIZE];
        let mut depth = 0;
        let (mut code, mut visited) = (T::ROOT, 0_u8);
        loop {
            match topology.resolve(code) {
                NodeRef::Block(block) => {
                    // Extend the union by the spheres of the block
                    let before = union.end;
                    let found = intervals(kernel, &tree, &prepared, block);
                    let next = union.extend(view, block, &found);
                    if union.end > limit {
                        return TreeExit::Beyond;
                    }
                    // Defer the spheres of the block that begin beyond the end
                    if next <= limit {
                        deferred.push(next.to_bits(), code, 0);
                    }
                    if union.end > before {
                        prepared = from(union.end);
                    }
                }
                NodeRef::Node(node) => {
                    // Push the children that begin before the end, and find the nearest one beyond it
                    let (found, keys) = kernel.test_node(&prepared, node, limit);
                    let children = topology.children(code);
                    let mut next = u32::MAX;
                    for key in &kernel.all_keys(keys)[..found] {
                        let (begins, slot) = (key & !7, key & 7);
                        if visited >> slot & 1 == 1 {
                            continue;
                        }
                        if f32::from_bits(begins) <= union.end {
                            visited |= 1 << slot;
                            stack[depth] = topology.child(children, slot);
                            depth += 1;
                        } else {
                            next = next.min(begins);
                        }
                    }
                    // Defer the other children: when the end reaches them, some of them may be skipped.
                    if next < u32::MAX {
                        deferred.push(next, code, visited);
                    }
                }
            }
            // Continue with the stack, then with deferred nodes that the end has reached
            if depth > 0 {
                depth -= 1;
                (code, visited) = (stack[depth], 0);
            } else if let Some(next) = deferred.pop_before(union.end) {
                (code, visited) = next;
            } else {
                break;
            }
        }
        match union.slot {
            Some(slot) => TreeExit::Here(TreeHit { t: union.end, slot }),
            None => TreeExit::NotInside,
        }
    }
}
