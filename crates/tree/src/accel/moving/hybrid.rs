//! Queries for packets of rays. As in [`crate::accel`]'s static trees, each box is tested with all rays while many of
//! them enter it, and a subtree that few rays enter is traversed by each of them alone. Spheres are always tested with
//! single rays, so each ray finds what it would find alone, to the bit.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::super::hits::TreeHits;
use super::super::simd::lanes_entering;
use super::MovingTree;
use super::node::{BLOCK, MovingBlock, MovingNode};
use super::single::{ROUNDING, RayInTime, RayStack, STACK_SIZE, inverse, walk_blocks};
use crate::blocks::{BLOCK_SIZE, WIDTH};
use crate::math::{LANES, Lanes, Lanes3, first_lanes, lane_kernel, lanes_in, larger, smaller};
use crate::ray::RayPacket;

/// A subtree that at most this many rays enter is traversed by each of them alone.
const MAX_SINGLE_RAYS: u32 = 5;

impl MovingTree {
    /// The first intersections of the rays in `lanes` between their ends. Particles with a lower index win ties.
    pub fn nearest(&self, rays: &RayPacket, lanes: u32) -> TreeHits {
        let mut hits = TreeHits { t: rays.t_max, slot: [TreeHits::NO_SLOT; LANES] };
        let lanes = lanes & self.lanes_entering(rays);
        if lanes != 0 {
            nearest(self.simd, &self.nodes, &self.blocks, &self.indices, rays, lanes, &mut hits);
        }
        hits
    }

    /// Bit mask of the rays in `lanes` that hit a sphere between their ends.
    pub fn occluded(&self, rays: &RayPacket, lanes: u32) -> u32 {
        match lanes & self.lanes_entering(rays) {
            0 => 0,
            lanes => occluded(self.simd, &self.nodes, &self.blocks, rays, lanes),
        }
    }

    /// The rays that may hit something. Rays with values that are not finite are not among them.
    fn lanes_entering(&self, rays: &RayPacket) -> u32 {
        if self.is_empty() {
            0
        } else {
            lanes_entering(rays, &self.bounds) & first_lanes(rays.len())
        }
    }

    /// Calls `visit` with each sphere that the line of the ray in `lane` passes through and that may begin before the
    /// end of the ray: its particle, its radius, and the distances of both intersections; until it returns false.
    pub fn visit_chords(
        &self,
        rays: &RayPacket,
        lane: usize,
        mut visit: impl FnMut(u32, f32, [f32; 2]) -> bool,
    ) {
        if self.lanes_entering(rays) >> lane & 1 == 0 {
            return;
        }
        let (ray, end) = (RayInTime::of(rays, lane), rays.t_max[lane]);
        let mut stack = RayStack::new();
        walk_blocks(&self.nodes, 0, &ray, &mut stack, end, |index, limit| {
            let block = &self.blocks[index];
            let [near, far] = ray.chords(block);
            let particles = &self.indices[index * BLOCK_SIZE..][..BLOCK_SIZE];
            for i in 0..BLOCK_SIZE {
                // Padding repeats the last particle of a block
                let is_new = i == 0 || particles[i] != particles[i - 1];
                let is_hit = near[i] < limit && far[i] >= ray.t_min;
                if is_new && is_hit && !visit(particles[i], block.radius[i], [near[i], far[i]]) {
                    return -1.0;
                }
            }
            limit
        });
    }
}

/// A search by many rays.
trait Query {
    /// Limit of the ray in `lane`; negative if it is finished.
    fn limit(&self, lane: usize) -> f32;

    /// Searches the block `index` for the ray in `lane`, and returns its new limit.
    fn visit(&mut self, index: usize, ray: &RayInTime, lane: usize) -> f32;
}

/// Searches for first intersections.
struct Nearest<'a> {
    blocks: &'a [MovingBlock],
    indices: &'a [u32],
    hits: &'a mut TreeHits,
}

impl Query for Nearest<'_> {
    #[inline(always)]
    fn limit(&self, lane: usize) -> f32 {
        self.hits.t[lane]
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
    fn visit(&mut self, index: usize, ray: &RayInTime, lane: usize) -> f32 {
        let t = ray.distances(&self.blocks[index]);
        let (mut limit, mut found) = (self.hits.t[lane], self.hits.slot[lane]);
        for i in 0..BLOCK_SIZE {
            if t[i] > limit {
                continue;
            }
            let slot = (index * BLOCK_SIZE + i) as u32;
            let is_nearer = t[i] < limit;
            // At the same distance, the lower index wins; the end of a ray is exclusive
            let wins = is_nearer
                || (found != TreeHits::NO_SLOT
                    && self.indices[slot as usize] < self.indices[found as usize]);
            if wins {
                (limit, found) = (t[i], slot);
            }
        }
        (self.hits.t[lane], self.hits.slot[lane]) = (limit, found);
        limit
    }
}

/// Searches for any intersection.
struct Any<'a> {
    blocks: &'a [MovingBlock],
    /// Ends of the rays; negative for rays that have hit something.
    limits: Lanes,
    occluded: u32,
}

impl Query for Any<'_> {
    #[inline(always)]
    fn limit(&self, lane: usize) -> f32 {
        self.limits[lane]
    }

    #[inline(always)]
    fn visit(&mut self, index: usize, ray: &RayInTime, lane: usize) -> f32 {
        let t = ray.distances(&self.blocks[index]);
        let mut is_hit = false;
        for t in t {
            is_hit |= t < self.limits[lane];
        }
        if is_hit {
            self.limits[lane] = -1.0;
            self.occluded |= 1 << lane;
        }
        self.limits[lane]
    }
}

#[inline(always)]
fn nearest_body(
    nodes: &[MovingNode],
    blocks: &[MovingBlock],
    indices: &[u32],
    rays: &RayPacket,
    lanes: u32,
    hits: &mut TreeHits,
) {
    let mut query = Nearest { blocks, indices, hits };
    walk_packet(nodes, rays, lanes, &mut query);
}

lane_kernel! {
    fn nearest(
        nodes: &[MovingNode],
        blocks: &[MovingBlock],
        indices: &[u32],
        rays: &RayPacket,
        lanes: u32,
        hits: &mut TreeHits,
    ) = nearest_body;
}

#[inline(always)]
fn occluded_body(
    nodes: &[MovingNode],
    blocks: &[MovingBlock],
    rays: &RayPacket,
    lanes: u32,
) -> u32 {
    let mut query = Any { blocks, limits: rays.t_max, occluded: 0 };
    walk_packet(nodes, rays, lanes, &mut query);
    query.occluded
}

lane_kernel! {
    fn occluded(nodes: &[MovingNode], blocks: &[MovingBlock], rays: &RayPacket, lanes: u32) -> u32 = occluded_body;
}

/// A subtree still to be visited.
#[derive(Clone, Copy, Default)]
struct Pending {
    /// Least entry distance of its rays.
    enter: f32,
    code: u32,
    /// The rays that enter its box.
    lanes: u32,
}

/// Visits the blocks that the rays of `lanes` reach.
#[inline(always)]
fn walk_packet(nodes: &[MovingNode], rays: &RayPacket, lanes: u32, query: &mut impl Query) {
    let mut inverses = [[0.0; LANES]; 3];
    for axis in 0..3 {
        for l in 0..LANES {
            inverses[axis][l] = inverse(rays.direction[axis][l]);
        }
    }
    let mut singles = RayStack::new();
    let mut stack = [Pending::default(); STACK_SIZE];
    stack[0].lanes = lanes;
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let Pending { enter, code, mut lanes } = stack[depth];
        // Forget rays that have ended before the subtree begins
        for lane in lanes_in(lanes) {
            if query.limit(lane) < enter * (1.0 - ROUNDING) {
                lanes &= !(1 << lane);
            }
        }
        if lanes.count_ones() <= MAX_SINGLE_RAYS || code & BLOCK != 0 {
            for lane in lanes_in(lanes) {
                let ray = RayInTime::of(rays, lane);
                let limit = query.limit(lane);
                if limit >= 0.0 {
                    walk_blocks(nodes, code, &ray, &mut singles, limit, |index, _| {
                        query.visit(index, &ray, lane)
                    });
                }
            }
            continue;
        }
        // Test the children with all rays, and push them, farthest first
        let node = &nodes[code as usize];
        let mut limits = [0.0; LANES];
        for (l, limit) in limits.iter_mut().enumerate() {
            *limit = query.limit(l);
        }
        let first = depth;
        for child in 0..WIDTH {
            let (enter, entering) = enter_child(node, child, rays, &inverses, &limits);
            let entering = entering & lanes;
            if entering == 0 {
                continue;
            }
            let mut least = f32::INFINITY;
            for lane in lanes_in(entering) {
                least = smaller(enter[lane], least);
            }
            let pending = Pending { enter: least, code: node.children[child], lanes: entering };
            let mut place = depth;
            while place > first && stack[place - 1].enter < least {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = pending;
            depth += 1;
        }
    }
}

/// Entry distances of all rays into the box of `child`, and the mask of the rays that enter it.
#[inline(always)]
fn enter_child(
    node: &MovingNode,
    child: usize,
    rays: &RayPacket,
    inverses: &Lanes3,
    limits: &Lanes,
) -> (Lanes, u32) {
    let (mut enter, mut exit) = (rays.t_min, *limits);
    for axis in 0..3 {
        let plane = |side: usize| {
            let (middle, change) = (&node.planes[side][axis], &node.changes[side][axis]);
            (middle[child], change[child])
        };
        let ((low, low_change), (high, high_change)) = (plane(0), plane(1));
        for l in 0..LANES {
            let (origin, inverse) = (rays.origin[axis][l], inverses[axis][l]);
            let a = (low + rays.time[l] * low_change - origin) * inverse;
            let b = (high + rays.time[l] * high_change - origin) * inverse;
            let is_forward = inverse > 0.0;
            enter[l] = larger(if is_forward { a } else { b }, enter[l]);
            exit[l] = smaller(if is_forward { b } else { a }, exit[l]);
        }
    }
    let mut lanes = 0;
    for l in 0..LANES {
        let is_entered = enter[l] * (1.0 - ROUNDING) <= exit[l] * (1.0 + ROUNDING);
        lanes |= u32::from(is_entered) << l;
    }
    (enter, lanes)
}
