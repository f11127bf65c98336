//! Traversal of the tree with beams of rays.
//!
//! The rays of a coherent packet whose directions have the same signs share a beam, which tests the eight boxes of a
//! node at once. The rays of a beam that finds too many grains, and all other rays, share nodes while many of them enter
//! the same ones, and are then traversed ray by ray. Boxes are larger than
//! their grains by more than the rounding of both tests, so each ray finds what it would find alone, to the bit.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::build::MAX_LEVELS;
use super::instance::Instance;
use super::node::{Beam, Code, Node, WIDTH, inverses, is_before, lanes_entering};
use super::rays::LocalRays;
use spherule_tree::accel::Coherence;
use spherule_tree::math::{LANES, Lanes, fold, lane_kernel, lanes_in, larger, smaller};

/// On every level, all children except one can be on the stack.
const STACK_SIZE: usize = MAX_LEVELS * (WIDTH - 1) + 1;

/// Number of grains that a beam of several rays tests before its rays are traversed one by one: it is too wide. On the
/// benchmark's ellipsoids, values from 24 to 96 give the same times up to noise, for camera and for shadow rays.
const MAX_BEAM_TESTS: u32 = 48;

/// A subtree that at most this many rays enter is traversed by each of them alone.
const MAX_SINGLE_RAYS: u32 = 4;

/// No grain.
pub(super) const NO_SLOT: u32 = u32::MAX;

/// A test of some rays and a grain. Implementations must be `inline(always)`, so that they are compiled for the
/// instruction set.
pub(super) trait GrainTest {
    /// The first distance in the range of each ray at which it crosses the surface of the grain in `slot`; infinite if
    /// there is none. Lanes outside `lanes` may have any value, and so may rays that cross it behind their limit.
    fn distances(&self, rays: &LocalRays, slot: usize, lanes: u32, limits: &Lanes) -> Lanes;

    /// The same distance for the ray in `lane`, to the bit.
    fn distance(&self, rays: &LocalRays, slot: usize, lane: usize, limit: f32) -> f32;
}

/// What a traversal searches for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Query {
    /// The first crossing of each ray. At equal distances, the grain with the lower index.
    Nearest,
    /// Any crossing, at which a ray ends.
    Any,
}

/// What rays have found.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct Hits {
    /// The distance of the crossing, or the end of the ray; negative for rays that are finished.
    pub(super) t: Lanes,
    /// The grain in tree order, or [`NO_SLOT`].
    pub(super) slot: [u32; LANES],
}

impl Hits {
    /// Nothing, for the rays of `rays.lanes`.
    pub(super) fn none(rays: &LocalRays) -> Self {
        let mut t = [-1.0; LANES];
        for lane in lanes_in(rays.lanes) {
            t[lane] = rays.to[lane];
        }
        Self { t, slot: [NO_SLOT; LANES] }
    }

    /// Lanes that have found a grain.
    pub(super) fn mask(&self) -> u32 {
        (0..LANES).fold(0, |mask, lane| mask | u32::from(self.slot[lane] != NO_SLOT) << lane)
    }

    /// Stores the distances `t` to the grain in `slot` for those rays of `lanes` for which it is the first one.
    #[inline(always)]
    fn take(&mut self, t: &Lanes, slot: u32, lanes: u32, grains: &[Instance], query: Query) {
        let mut tied = 0;
        for l in 0..LANES {
            let is_tied = t[l] == self.t[l] && self.slot[l] != NO_SLOT;
            tied |= u32::from(is_tied) << l;
        }
        for l in 0..LANES {
            let is_nearer = t[l] < self.t[l] && lanes >> l & 1 == 1;
            let end = if query == Query::Any { -1.0 } else { t[l] };
            self.slot[l] = if is_nearer { slot } else { self.slot[l] };
            self.t[l] = if is_nearer { end } else { self.t[l] };
        }
        for lane in lanes_in(tied & lanes) {
            self.resolve_tie(lane, slot, grains);
        }
    }

    /// Stores the distance `t` of the ray in `lane` to the grain in `slot` if it is the first one.
    #[inline(always)]
    fn take_one(&mut self, t: f32, slot: u32, lane: usize, grains: &[Instance], query: Query) {
        if t < self.t[lane] {
            self.slot[lane] = slot;
            self.t[lane] = if query == Query::Any { -1.0 } else { t };
        } else if t == self.t[lane] && self.slot[lane] != NO_SLOT {
            self.resolve_tie(lane, slot, grains);
        }
    }

    /// Stores the grain in `slot` in `lane` if its index is lower than that of the current one.
    #[cold]
    fn resolve_tie(&mut self, lane: usize, slot: u32, grains: &[Instance]) {
        if grains[slot as usize].index < grains[self.slot[lane] as usize].index {
            self.slot[lane] = slot;
        }
    }
}

/// A node or leaf still to be visited, as one word: the bits of the distance at which it is entered, then its code.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Pending(u64);

impl Pending {
    #[inline(always)]
    fn new(enter: f32, code: Code) -> Self {
        Self(u64::from(larger(enter, 0.0).to_bits()) << 32 | u64::from(code.0))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the two halves")]
    fn split(self) -> (f32, Code) {
        (f32::from_bits((self.0 >> 32) as u32), Code(self.0 as u32))
    }
}

/// A node or leaf still to be visited by some rays.
#[derive(Clone, Copy, Default)]
struct PendingLanes {
    /// The least distance at which a ray enters it.
    enter: f32,
    code: Code,
    lanes: u32,
}

/// A traversal by the rays of some lanes.
struct Search<'a, T> {
    nodes: &'a [Node],
    grains: &'a [Instance],
    rays: &'a LocalRays,
    test: &'a T,
    query: Query,
    hits: &'a mut Hits,
    stack: [Pending; STACK_SIZE],
}

impl<T: GrainTest> Search<'_, T> {
    /// The farthest end of the rays that are positive in `members`; negative if all are finished.
    #[inline(always)]
    fn limit(&self, members: &Lanes) -> f32 {
        let mut ends = [0.0; LANES];
        for l in 0..LANES {
            ends[l] = smaller(self.hits.t[l], members[l]);
        }
        fold(ends, larger)
    }

    /// Traverses the tree with a beam around the rays of `lanes`. Returns false if it gave up after too many tests.
    #[inline(always)]
    fn run_beam(&mut self, lanes: u32) -> bool {
        let beam = Beam::around(self.rays, lanes);
        let mut members = [-1.0; LANES];
        for lane in lanes_in(lanes) {
            members[lane] = f32::INFINITY;
        }
        let mut tests_left = MAX_BEAM_TESTS;
        let mut limit = self.limit(&members);
        let (mut next, mut depth) = (Some(Code(0)), 0);
        while let Some(code) = next {
            if let Some(slot) = code.as_leaf() {
                // Test the grain, which may shorten the rays
                let hits = &mut *self.hits;
                let t = self.test.distances(self.rays, slot as usize, lanes, &hits.t);
                hits.take(&t, slot, lanes, self.grains, self.query);
                limit = self.limit(&members);
                if limit < 0.0 {
                    return true;
                }
                if tests_left == 0 {
                    return false;
                }
                tests_left -= 1;
            } else {
                depth = self.push_children::<false>(&beam, code, depth, limit);
            }
            (next, depth) = self.pop(depth, limit);
        }
        true
    }

    /// Traverses the tree with the rays of `lanes`, in any directions: boxes are tested with all rays at once while many
    /// of them enter the same node, and a subtree that few rays enter is traversed by each of them alone (Wald et al.,
    /// "Embree: a kernel framework for efficient CPU ray tracing", 2014, section 4.2).
    #[inline(always)]
    fn run_packet(&mut self, lanes: u32) {
        let inverses = inverses(self.rays);
        let mut stack = [PendingLanes::default(); STACK_SIZE];
        stack[0].lanes = lanes;
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let PendingLanes { enter, code, lanes } = stack[depth];
            // Forget rays that have ended before the subtree begins
            let mut alive = 0;
            for l in 0..LANES {
                alive |= u32::from(is_before(enter, self.hits.t[l])) << l;
            }
            let lanes = lanes & alive;
            if lanes.count_ones() <= MAX_SINGLE_RAYS {
                for lane in lanes_in(lanes) {
                    self.run_ray(code, lane);
                }
            } else if let Some(slot) = code.as_leaf() {
                let hits = &mut *self.hits;
                let t = self.test.distances(self.rays, slot as usize, lanes, &hits.t);
                hits.take(&t, slot, lanes, self.grains, self.query);
            } else {
                let node = &self.nodes[code.0 as usize];
                let first = depth;
                for child in 0..WIDTH {
                    if !node.has_child(child) {
                        continue;
                    }
                    let (enter, entering) =
                        lanes_entering(node, child, self.rays, &inverses, &self.hits.t);
                    let lanes = lanes & entering;
                    if lanes == 0 {
                        continue;
                    }
                    // Keep the nearest last
                    let code = node.children[child];
                    let mut place = depth;
                    while place > first && stack[place - 1].enter < enter {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = PendingLanes { enter, code, lanes };
                    depth += 1;
                }
            }
        }
    }

    /// Traverses the subtree with `code` with the ray in `lane`.
    #[inline(always)]
    fn run_ray(&mut self, code: Code, lane: usize) {
        let beam = Beam::of(self.rays, lane);
        let mut limit = self.hits.t[lane];
        let (mut next, mut depth) = (Some(code), 0);
        while let Some(code) = next {
            if let Some(slot) = code.as_leaf() {
                let t = self.test.distance(self.rays, slot as usize, lane, limit);
                self.hits.take_one(t, slot, lane, self.grains, self.query);
                limit = self.hits.t[lane];
                if limit < 0.0 {
                    return;
                }
            } else {
                depth = self.push_children::<true>(&beam, code, depth, limit);
            }
            (next, depth) = self.pop(depth, limit);
        }
    }

    /// The next node that begins before `limit`, and the new depth of the stack.
    #[inline(always)]
    fn pop(&self, mut depth: usize, limit: f32) -> (Option<Code>, usize) {
        while depth > 0 {
            depth -= 1;
            let (enter, code) = self.stack[depth].split();
            if is_before(enter, limit) {
                return (Some(code), depth);
            }
        }
        (None, 0)
    }

    /// Pushes the children of a node that the beam enters, nearest last. Returns the new depth of the stack.
    #[inline(always)]
    fn push_children<const IS_RAY: bool>(
        &mut self,
        beam: &Beam,
        code: Code,
        mut depth: usize,
        limit: f32,
    ) -> usize {
        let node = &self.nodes[code.0 as usize];
        let enter = beam.entries::<IS_RAY>(node, limit);
        let mut entered = 0;
        for (i, enter) in enter.iter().enumerate() {
            entered |= u32::from(*enter < f32::INFINITY) << i;
        }
        let first = depth;
        for i in lanes_in(entered) {
            let pending = Pending::new(enter[i & (WIDTH - 1)], node.children[i & (WIDTH - 1)]);
            let mut place = depth;
            while place > first && self.stack[place - 1] < pending {
                self.stack[place] = self.stack[place - 1];
                place -= 1;
            }
            self.stack[place] = pending;
            depth += 1;
        }
        depth
    }
}

/// The lanes of `left` whose directions have the same signs as that of the first one.
#[inline(always)]
fn lanes_like_first(rays: &LocalRays, left: u32) -> u32 {
    let mut octants = [0; LANES];
    for (axis, directions) in rays.direction.iter().enumerate() {
        for l in 0..LANES {
            octants[l] |= (directions[l].to_bits() >> 31) << axis;
        }
    }
    let own = octants[left.trailing_zeros() as usize & (LANES - 1)];
    let mut same = 0;
    for (l, octant) in octants.iter().enumerate() {
        same |= u32::from(*octant == own) << l;
    }
    same & left
}

#[inline(always)]
fn search_body<T: GrainTest>(
    nodes: &[Node],
    grains: &[Instance],
    rays: &LocalRays,
    coherence: Coherence,
    test: &T,
    query: Query,
    hits: &mut Hits,
) {
    if nodes.is_empty() {
        return;
    }
    let stack = [Pending::default(); STACK_SIZE];
    let mut search = Search { nodes, grains, rays, test, query, hits, stack };
    let mut left = rays.lanes;
    // Beams of rays with the same signs; those that find too many grains are continued ray by ray
    let mut alone = if coherence == Coherence::Coherent { 0 } else { left };
    left &= !alone;
    while left != 0 {
        let group = lanes_like_first(rays, left);
        left &= !group;
        if group & (group - 1) == 0 || !search.run_beam(group) {
            alone |= group;
        }
    }
    if alone != 0 {
        search.run_packet(alone);
    }
}

lane_kernel! {
    /// Searches the grains of the tree for the rays of `rays.lanes`.
    pub(super) fn search<T: GrainTest>(
        nodes: &[Node],
        grains: &[Instance],
        rays: &LocalRays,
        coherence: Coherence,
        test: &T,
        query: Query,
            hits: &mut Hits,
    ) = search_body;
}
