//! The union of a tree's spheres along a ray: where it is entered, and where it is left.
//!
//! Each sphere that a ray passes through covers an interval of it; the union ends where the intervals
//! that overlap one another from the ray's start on end together. They are gathered from the front: what
//! begins before the end that is known may move it on, and what ends before it is passed over, so that a
//! ray sees no more of a deep body than it crosses. Which end comes out is a matter of the intervals
//! alone, not of the order in which they are found, nor of how often one is.

use std::borrow::Borrow;
use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::Vec3;

use super::leaves::{Leaves, LoadedRadii};
use super::simd::{BlockCrossings, PacketKernel};
use super::topology::{Place, Topology};
use super::traverse::TreeHit;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::{STACK_SIZE, walk};
use crate::ray::Ray;
use spherule_formats::blocks::BLOCK_SIZE;

/// Where a ray that starts inside spheres comes out of all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TreeExit {
    /// Out of this sphere, the last one.
    Here(TreeHit),
    /// Not before `ray.t_max`.
    Beyond,
    /// It does not start inside any.
    NotInside,
}

impl TreeView<'_> {
    /// Where a ray that starts outside all spheres enters the first, within `ray.t_min..ray.t_max`; equal
    /// distances go to the lower particle index. A ray that starts inside a sphere all the same enters it
    /// at `ray.t_min` if it goes deeper, and leaves it unnoticed if not.
    pub fn entry(&self, ray: &Ray) -> Option<TreeHit> {
        if !self.may_be_met_by(ray) {
            return None;
        }
        self.run(Entry { ray })
    }

    /// Where a ray that is inside spheres at `ray.t_min` comes out of their union. Of spheres that end
    /// there together, the one with the lowest particle index.
    pub fn exit(&self, ray: &Ray) -> TreeExit {
        thread_local! {
            /// Rays of a thread follow one another: one buffer serves them all.
            static LATER: RefCell<Later> = const { RefCell::new(Later::new()) };
        }
        LATER.with_borrow_mut(|later| {
            later.clear();
            self.run(Exit { ray, later })
        })
    }

    /// Whether `point` lies in or on any sphere.
    pub fn contains(&self, point: Vec3) -> bool {
        let bounds = self.bounds;
        if point.cmplt(bounds.min).any() || point.cmpgt(bounds.max).any() {
            return false;
        }
        let ray = Ray {
            t_max: 0.0,
            ..Ray::new(point, Vec3::X)
        };
        self.run(Contains { ray: &ray })
    }
}

/// The lanes that are set, with their slots as far as they hold particles.
#[inline(always)]
fn slots_of(block: usize, mut lanes: u32, slots: usize) -> impl Iterator<Item = (usize, u32)> {
    std::iter::from_fn(move || {
        let lane = lanes.trailing_zeros() as usize;
        let slot = block * BLOCK_SIZE + lane;
        if lanes == 0 || slot >= slots {
            return None;
        }
        lanes &= lanes - 1;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "slots are counted in 32 bits"
        )]
        Some((lane, slot as u32))
    })
}

/// The intervals that the spheres of a block cover of the line of `ray`.
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
        let prepared = kernel.prepare(ray, view.radius, view.padding);
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
                    let Some(t) = entered(found.near[lane], found.far[lane], ray.t_min) else {
                        continue;
                    };
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

/// Where a ray that begins at `t_min` enters a sphere that covers `near..far` of its line. Of a sphere that
/// it starts in, though it should not, only the first half counts; one that is merely touched has no inside,
/// so that what is entered is left farther on.
#[inline(always)]
fn entered(near: f32, far: f32, t_min: f32) -> Option<f32> {
    if near >= t_min {
        (far > near).then_some(near)
    } else {
        (near + far > 2.0 * t_min).then_some(t_min)
    }
}

struct Contains<'r> {
    /// Of no length.
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
        let prepared = kernel.prepare(self.ray, view.radius, view.padding);
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

/// What begins beyond the end that is known, nearest first.
#[derive(Debug)]
struct Later(BinaryHeap<Reverse<Begins>>);

/// A block, or the rest of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Begins {
    /// Bits of the distance at which the next of it begins above, which order like integers as they are not
    /// negative; the code below.
    place: u64,
    /// The children of a node that are done with.
    done: u8,
}

impl Later {
    const fn new() -> Self {
        Self(BinaryHeap::new())
    }

    fn clear(&mut self) {
        self.0.clear();
    }

    #[inline(always)]
    fn push(&mut self, distance: u32, code: u32, done: u8) {
        let place = (u64::from(distance) << 32) | u64::from(code);
        self.0.push(Reverse(Begins { place, done }));
    }

    /// The nearest one, if it begins no later than `end`: its code and the children that are done with.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the two halves")]
    fn pop_before(&mut self, end: f32) -> Option<(u32, u8)> {
        let Reverse(Begins { place, .. }) = self.0.peek()?;
        let begins = f32::from_bits((place >> 32) as u32);
        if begins > end {
            return None;
        }
        let Reverse(Begins { place, done }) = self.0.pop()?;
        Some((place as u32, done))
    }
}

struct Exit<'r> {
    ray: &'r Ray,
    later: &'r mut Later,
}

/// How far the union is known to reach.
struct Reach {
    end: f32,
    /// The last sphere; none while it is that of no sphere.
    slot: Option<u32>,
}

impl Reach {
    /// Takes the intervals of a block in. Returns the least distance at which one begins beyond the end, or
    /// infinity.
    #[inline(always)]
    fn extend(&mut self, view: &TreeView, block: usize, found: &BlockCrossings) -> f32 {
        loop {
            let before = self.end;
            let mut next = f32::INFINITY;
            for (lane, slot) in slots_of(block, found.lanes, view.slot_count()) {
                let (near, far) = (found.near[lane], found.far[lane]);
                if near > self.end {
                    next = next.min(near);
                } else if far > self.end || (far == self.end && self.gives_way_to(view, slot)) {
                    *self = Self {
                        end: far,
                        slot: Some(slot),
                    };
                }
            }
            // An end that moved on may have come to others of the block.
            if self.end == before || next > self.end {
                return next;
            }
        }
    }

    /// Whether `slot`, which ends where the union does, comes before the one that is known.
    fn gives_way_to(&self, view: &TreeView, slot: u32) -> bool {
        self.slot
            .is_none_or(|held| view.tie_order(slot, held).is_lt())
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
        let Self { ray, later } = self;
        let (view, topology) = (tree.view, tree.topology);
        if view.is_empty() {
            return TreeExit::NotInside;
        }
        // Boxes that are left before the end count no longer.
        let from = |t_min: f32| kernel.prepare(&Ray { t_min, ..*ray }, view.radius, view.padding);
        let limit = ray.t_max.next_down();
        let mut reach = Reach {
            end: ray.t_min,
            slot: None,
        };
        let mut prepared = from(reach.end);
        // What begins before the end; no more of it than below one code at a time.
        let mut stack = [0_u32; STACK_SIZE];
        let mut depth = 0;
        let (mut code, mut done) = (T::ROOT, 0_u8);
        loop {
            match topology.place(code) {
                Place::Block(block) => {
                    let before = reach.end;
                    let found = intervals(kernel, &tree, &prepared, block);
                    let next = reach.extend(view, block, &found);
                    if reach.end > limit {
                        return TreeExit::Beyond;
                    }
                    if next <= limit {
                        later.push(next.to_bits(), code, 0);
                    }
                    if reach.end > before {
                        prepared = from(reach.end);
                    }
                }
                Place::Node(node) => {
                    let (found, keys) = kernel.test_node(&prepared, node, limit);
                    let children = topology.children(code);
                    let mut next = u32::MAX;
                    for key in &kernel.all_keys(keys)[..found] {
                        let (begins, slot) = (key & !7, key & 7);
                        if done >> slot & 1 == 1 {
                            continue;
                        }
                        if f32::from_bits(begins) <= reach.end {
                            done |= 1 << slot;
                            stack[depth] = topology.child(children, slot);
                            depth += 1;
                        } else {
                            next = next.min(begins);
                        }
                    }
                    // The rest is looked at again: by then some of it may end before the end.
                    if next < u32::MAX {
                        later.push(next, code, done);
                    }
                }
            }
            if depth > 0 {
                depth -= 1;
                (code, done) = (stack[depth], 0);
            } else if let Some(next) = later.pop_before(reach.end) {
                (code, done) = next;
            } else {
                break;
            }
        }
        match reach.slot {
            Some(slot) => TreeExit::Here(TreeHit { t: reach.end, slot }),
            None => TreeExit::NotInside,
        }
    }
}
