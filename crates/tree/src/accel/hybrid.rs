//! Hybrid traversal for packets of any rays: each child box is tested with all rays at once while many of them enter
//! the same node; a subtree that only few rays enter is traversed by each of them alone.
//!
//! Follows Embree (Wald et al. 2014, "Embree: a kernel framework for efficient CPU ray tracing", section 4.2). Box
//! tests are conservative, and spheres are tested with the code for single rays. So each ray finds exactly what it
//! would find alone, to the bit.

use super::hits::TreeHits;
use super::leaves::Leaves;
use super::simd::{EnteredChildren, LaneSlabs, PacketKernel, lanes_entering};
use super::topology::{NodeRef, Topology};
use super::traverse::{AnyOfRay, ChordsOfRay, EntriesOfRay, NearestOfRay, TreeChord, TreeHit};
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::{Below, STACK_SIZE, WalkStack, Walker, sort_descending, walk_from};
use crate::math::{first_lanes, lanes_in};
use crate::ray::{PACKET_SIZE, RayPacket};

/// A subtree that at most this many rays enter is traversed by each of them alone. Measured with reflection and
/// shadow rays of the thesis's box with 1e5 and 1e6 particles (k-d tree). The speedup over single rays on AVX-512,
/// for reflections in the smaller box, is 0: 2.02, 2: 2.07, 4: 2.11, 5: 2.08, 6: 2.03, 8: 2.00, 10: 1.92. AVX2 and
/// the portable kernel have an equally flat optimum, so one value serves all.
const MAX_SINGLE_RAYS: u32 = 5;

impl TreeView<'_> {
    /// [`TreeView::nearest`] for the rays in `lanes`; the other rays hit nothing.
    pub(super) fn nearest_by_lanes(&self, rays: &RayPacket, lanes: u32, hits: &mut TreeHits) {
        let backward = backward_lanes(rays) & lanes;
        self.run(LaneQuery { rays, lanes: lanes & !backward, query: Nearest, hits });
        for lane in lanes_in(backward) {
            if let Some(hit) = self.nearest(&rays.ray(lane)) {
                (hits.t[lane], hits.slot[lane]) = (hit.t, hit.slot);
            }
        }
    }

    /// [`TreeView::any_hit`] for the rays in `lanes`.
    pub(super) fn occluded_by_lanes(&self, rays: &RayPacket, lanes: u32) -> u32 {
        let backward = backward_lanes(rays) & lanes;
        let mut hits = TreeHits::default();
        self.run(LaneQuery { rays, lanes: lanes & !backward, query: Any, hits: &mut hits });
        let mut occluded = hits.mask();
        for lane in lanes_in(backward) {
            occluded |= u32::from(self.any_hit(&rays.ray(lane))) << lane;
        }
        occluded
    }
}

impl TreeView<'_> {
    /// Calls `visit` for every sphere that the lines of the rays in `lanes` pass through and that may begin before
    /// the end of the ray, in traversal order, until it returns false for a ray. Spheres behind the origin are not
    /// visited.
    pub fn visit_chords(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: impl FnMut(usize, TreeChord) -> bool,
    ) {
        self.run(LaneQuery {
            rays,
            lanes,
            query: Chords { visit },
            hits: &mut TreeHits::default(),
        });
    }
}

impl TreeView<'_> {
    /// Calls `visit` for the spheres that rays in `lanes` enter between their ends, nearer boxes first. It returns the
    /// distance behind which further spheres do not matter to the ray: at most the current one, or a negative one to
    /// end the ray. Spheres of trees with copies may be visited several times.
    pub fn visit_entries(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: impl FnMut(usize, TreeHit) -> Option<f32>,
    ) {
        self.run(LaneQuery {
            rays,
            lanes,
            query: Entries { t_min: &rays.t_min, visit },
            hits: &mut TreeHits::default(),
        });
    }
}

/// Rays with a negative `t_min`. They are traced alone, because distances on the stack must not be negative.
#[inline]
fn backward_lanes(rays: &RayPacket) -> u32 {
    let mut lanes = 0;
    for (lane, t_min) in rays.t_min.iter().enumerate() {
        lanes |= u32::from(*t_min < 0.0) << lane;
    }
    lanes & first_lanes(rays.len())
}

/// A query for the rays in `lanes`.
struct LaneQuery<'r, 'h, Q> {
    rays: &'r RayPacket,
    lanes: u32,
    query: Q,
    hits: &'h mut TreeHits,
}

impl<Q: Query> TreeTask for LaneQuery<'_, '_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        mut self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) {
        let lanes = self.lanes & lanes_entering(self.rays, &tree.view.bounds);
        self.hits.start(self.rays, lanes);
        walk_lanes(kernel, tree, self.rays, lanes, &mut self.query, self.hits);
    }
}

/// A subtree that one ray traverses alone.
struct Subtree<'s, 'a, K, T, L> {
    kernel: K,
    tree: Resolved<'a, T, L>,
    code: u32,
    stack: &'s mut WalkStack,
}

impl<'a, K: PacketKernel, T: Topology<'a>, L: Leaves> Subtree<'_, 'a, K, T, L> {
    /// Visits the blocks of the subtree up to `limit`.
    #[inline(always)]
    fn walk(self, walker: &mut impl Walker<K>, limit: f32) {
        walk_from(self.kernel, self.tree, self.code, self.stack, walker, limit);
    }
}

/// What the rays search for. This is a trait and not a closure, because all of it must be inlined to be compiled with
/// the instructions of the kernel.
trait Query {
    /// Searches a subtree, and stores the result of `ray` in its `lane` of `hits`.
    fn search<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        &mut self,
        subtree: Subtree<'_, 'a, K, T, L>,
        ray: &K::Ray,
        hits: &mut TreeHits,
        lane: usize,
    );
}

/// Searches for the nearest hit.
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
        let best = TreeHit { t: hits.t[lane], slot: hits.slot[lane] };
        let tree = subtree.tree;
        let mut search = NearestOfRay { tree, ray, best };
        subtree.walk(&mut search, best.t);
        (hits.t[lane], hits.slot[lane]) = (search.best.t, search.best.slot);
    }
}

/// Searches for any hit, which finishes the ray.
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

/// Visits all spheres on the lines of the rays.
struct Chords<F> {
    /// Called with a lane and a chord; false finishes the ray.
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

/// Visits the spheres that the rays enter.
struct Entries<'r, F> {
    t_min: &'r [f32; PACKET_SIZE],
    /// Called with a lane and an entry; returns the new limit of the ray, if it changes.
    visit: F,
}

impl<F: FnMut(usize, TreeHit) -> Option<f32>> Query for Entries<'_, F> {
    #[inline(always)]
    fn search<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        &mut self,
        subtree: Subtree<'_, 'a, K, T, L>,
        ray: &K::Ray,
        hits: &mut TreeHits,
        lane: usize,
    ) {
        let (tree, limit) = (subtree.tree, hits.t[lane]);
        let visit = |hit| (self.visit)(lane, hit);
        let mut search = EntriesOfRay { tree, ray, t_min: self.t_min[lane], limit, visit };
        subtree.walk(&mut search, limit);
        hits.t[lane] = search.limit;
    }
}

/// Nodes and blocks still to be visited, with the entry distance of each ray.
struct LaneStack {
    near: [[f32; PACKET_SIZE]; STACK_SIZE],
    code: [u32; STACK_SIZE],
    depth: usize,
}

/// Runs `query` for the rays in `lanes`; `hits` holds their limits.
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
    // Start at the root with all rays
    let slabs = LaneSlabs::new(rays, view.padding);
    let mut entered = EnteredChildren::NONE;
    let mut single_stack = WalkStack::new();
    let mut stack =
        LaneStack { near: [[0.0; PACKET_SIZE]; STACK_SIZE], code: [0; STACK_SIZE], depth: 0 };
    let (mut code, mut alive) = (T::ROOT, lanes);
    loop {
        match tree.topology.resolve(code) {
            // Many rays enter the node: test its children with all of them, and push the nearest child last
            NodeRef::Node(node) if alive.count_ones() > MAX_SINGLE_RAYS => {
                let found = kernel.test_node_with_lanes(&slabs, node, alive, &hits.t, &mut entered);
                let below = Below { tree, children: tree.topology.children(code) };
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
            // Few rays enter the node, or it is a block: traverse the subtree with each ray alone
            _ => {
                for lane in lanes_in(alive) {
                    let (ray, inverse) = (rays.ray(lane), slabs.inverse(lane));
                    let ray = kernel.prepare(&ray, inverse, view.radius, view.padding);
                    let subtree = Subtree { kernel, tree, code, stack: &mut single_stack };
                    query.search(subtree, &ray, hits, lane);
                }
            }
        }
        // Pop the next node that still begins before the limit of some ray
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
