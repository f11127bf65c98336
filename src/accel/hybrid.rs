//! The traversal for packets of any rays: each child box is tested with all rays at once while many of
//! them enter a node together, and each goes on alone from where only few are left.
//!
//! Hybrid traversal as in Embree (Wald et al. 2014, "Embree: a kernel framework for efficient CPU ray
//! tracing", section 4.2). Boxes are tested conservatively and rays meet spheres by the tests of single
//! rays, so that each finds what it finds alone, to the bit.

use super::hits::TreeHits;
use super::leaves::Leaves;
use super::simd::{EnteredChildren, LaneSlabs, PacketKernel, lanes_near};
use super::topology::{Place, Topology};
use super::traverse::{AnyOfRay, ChordsOfRay, NearestOfRay, TreeChord, TreeHit};
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::{Below, STACK_SIZE, WalkStack, Walker, sort_descending, walk_from};
use crate::math::{first_lanes, lanes_in};
use crate::ray::{PACKET_SIZE, RayPacket};

/// Rays that go on alone from a node when no more than these are alive there. Reflections and shadow rays
/// of the thesis's box with 1e5 and 1e6 particles (k-d tree): times faster than single rays by this number
/// on AVX-512 are, for reflections in the smaller box, 0: 2.02, 2: 2.07, 4: 2.11, 5: 2.08, 6: 2.03, 8: 2.00,
/// 10: 1.92. AVX2 and the portable kernel are as flat, so that one number does for all.
const MOST_ALONE: u32 = 5;

impl TreeView<'_> {
    /// [`TreeView::nearest`] of the rays in `lanes`; the others hit nothing.
    pub(super) fn nearest_by_lanes(&self, rays: &RayPacket, lanes: u32, hits: &mut TreeHits) {
        let backward = backward_lanes(rays) & lanes;
        self.run(ByLanes {
            rays,
            lanes: lanes & !backward,
            query: Nearest,
            hits,
        });
        for lane in lanes_in(backward) {
            if let Some(hit) = self.nearest(&rays.ray(lane)) {
                (hits.t[lane], hits.slot[lane]) = (hit.t, hit.slot);
            }
        }
    }

    /// [`TreeView::any_hit`] of the rays in `lanes`.
    pub(super) fn occluded_by_lanes(&self, rays: &RayPacket, lanes: u32) -> u32 {
        let backward = backward_lanes(rays) & lanes;
        let mut hits = TreeHits::default();
        self.run(ByLanes {
            rays,
            lanes: lanes & !backward,
            query: Any,
            hits: &mut hits,
        });
        let mut occluded = hits.mask();
        for lane in lanes_in(backward) {
            occluded |= u32::from(self.any_hit(&rays.ray(lane))) << lane;
        }
        occluded
    }
}

impl TreeView<'_> {
    /// Gives `visit` every sphere on the lines of the rays in `lanes` that may lie before their ends, in the order of
    /// the walk, until it returns false for a ray. Rays count from their origin on.
    pub(crate) fn visit_chords(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: impl FnMut(usize, TreeChord) -> bool,
    ) {
        self.run(ByLanes {
            rays,
            lanes,
            query: Chords { visit },
            hits: &mut TreeHits::default(),
        });
    }
}

/// The rays that count from behind their origin on. Distances on the stack are not negative, so they are
/// traced alone.
#[inline]
fn backward_lanes(rays: &RayPacket) -> u32 {
    let mut lanes = 0;
    for (lane, t_min) in rays.t_min.iter().enumerate() {
        lanes |= u32::from(*t_min < 0.0) << lane;
    }
    lanes & first_lanes(rays.len())
}

/// Brings the rays in `lanes` to what they look for.
struct ByLanes<'r, 'h, Q> {
    rays: &'r RayPacket,
    lanes: u32,
    query: Q,
    hits: &'h mut TreeHits,
}

impl<Q: Query> TreeTask for ByLanes<'_, '_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        mut self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) {
        let lanes = self.lanes & lanes_near(self.rays, &tree.view.bounds);
        self.hits.start(self.rays, lanes);
        walk_lanes(kernel, tree, self.rays, lanes, &mut self.query, self.hits);
    }
}

/// A part of a tree that a ray goes through alone.
struct Subtree<'s, 'a, K, T, L> {
    kernel: K,
    tree: Resolved<'a, T, L>,
    code: u32,
    stack: &'s mut WalkStack,
}

impl<'a, K: PacketKernel, T: Topology<'a>, L: Leaves> Subtree<'_, 'a, K, T, L> {
    /// Visits its blocks up to `limit`.
    #[inline(always)]
    fn walk(self, walker: &mut impl Walker<K>, limit: f32) {
        walk_from(self.kernel, self.tree, self.code, self.stack, walker, limit);
    }
}

/// What rays look for. A trait instead of a closure, because all of it must be inlined to get the
/// kernel's instructions.
trait Query {
    /// Looks for it in a subtree, and keeps what `ray` finds in its `lane`.
    fn search<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        &mut self,
        subtree: Subtree<'_, 'a, K, T, L>,
        ray: &K::Ray,
        hits: &mut TreeHits,
        lane: usize,
    );
}

/// The nearest hit.
struct Nearest;

impl Query for Nearest {
    #[inline(always)]
    fn search<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        &mut self,
        subtree: Subtree<'_, 'a, K, T, L>,
        ray: &K::Ray,
        hits: &mut TreeHits,
        lane: usize,
    ) {
        let best = TreeHit {
            t: hits.t[lane],
            slot: hits.slot[lane],
        };
        let tree = subtree.tree;
        let mut search = NearestOfRay { tree, ray, best };
        subtree.walk(&mut search, best.t);
        (hits.t[lane], hits.slot[lane]) = (search.best.t, search.best.slot);
    }
}

/// Any hit, which finishes the ray.
struct Any;

impl Query for Any {
    #[inline(always)]
    fn search<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        &mut self,
        subtree: Subtree<'_, 'a, K, T, L>,
        ray: &K::Ray,
        hits: &mut TreeHits,
        lane: usize,
    ) {
        let (tree, found) = (subtree.tree, false);
        let mut search = AnyOfRay { tree, ray, found };
        subtree.walk(&mut search, hits.t[lane]);
        if search.found {
            (hits.t[lane], hits.slot[lane]) = (-1.0, 0);
        }
    }
}

/// All spheres on the lines of the rays.
struct Chords<F> {
    /// Gets a lane and a chord; false finishes the ray.
    visit: F,
}

impl<F: FnMut(usize, TreeChord) -> bool> Query for Chords<F> {
    #[inline(always)]
    fn search<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        &mut self,
        subtree: Subtree<'_, 'a, K, T, L>,
        ray: &K::Ray,
        hits: &mut TreeHits,
        lane: usize,
    ) {
        let mut is_finished = false;
        let visit = |chord| {
            is_finished = !(self.visit)(lane, chord);
            !is_finished
        };
        let tree = subtree.tree;
        let mut search = ChordsOfRay { tree, ray, visit };
        subtree.walk(&mut search, hits.t[lane]);
        if is_finished {
            hits.t[lane] = -1.0;
        }
    }
}

/// Nodes and blocks still to visit, and where each ray enters them.
struct LaneStack {
    near: [[f32; PACKET_SIZE]; STACK_SIZE],
    code: [u32; STACK_SIZE],
    depth: usize,
}

/// Brings the rays in `lanes` to what they look for; `hits` has their limits.
#[inline(always)]
fn walk_lanes<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
    kernel: K,
    tree: Resolved<'a, T, L>,
    rays: &RayPacket,
    lanes: u32,
    query: &mut impl Query,
    hits: &mut TreeHits,
) {
    let view = tree.view;
    if lanes == 0 || view.is_empty() {
        return;
    }
    let slabs = LaneSlabs::new(rays, view.padding);
    let mut entered = EnteredChildren::NONE;
    let mut single_stack = WalkStack::new();
    let mut stack = LaneStack {
        near: [[0.0; PACKET_SIZE]; STACK_SIZE],
        code: [0; STACK_SIZE],
        depth: 0,
    };
    let (mut code, mut alive) = (T::ROOT, lanes);
    loop {
        match tree.topology.place(code) {
            // Many rays: find the children that they enter, the nearest last
            Place::Node(node) if alive.count_ones() > MOST_ALONE => {
                let found = kernel.test_node_with_lanes(&slabs, node, alive, &hits.t, &mut entered);
                let below = Below {
                    tree,
                    children: tree.topology.children(code),
                };
                let keys = &mut entered.keys[..found];
                sort_descending(keys);
                for key in keys {
                    let child = below.code(*key);
                    below.prefetch(kernel, child);
                    stack.near[stack.depth] = entered.near[(*key & 7) as usize];
                    stack.code[stack.depth] = child;
                    stack.depth += 1;
                }
            }
            // Few rays, or a block: each goes on alone
            _ => {
                for lane in lanes_in(alive) {
                    let ray = kernel.prepare(&rays.ray(lane), view.radius, view.padding);
                    let subtree = Subtree {
                        kernel,
                        tree,
                        code,
                        stack: &mut single_stack,
                    };
                    query.search(subtree, &ray, hits, lane);
                }
            }
        }
        // Go on where the next place is still of use to a ray
        loop {
            if stack.depth == 0 {
                return;
            }
            stack.depth -= 1;
            alive = kernel.lanes_within(&stack.near[stack.depth], &hits.t);
            if alive != 0 {
                code = stack.code[stack.depth];
                break;
            }
        }
    }
}
