//! Traversal by one ray, and its tests of boxes and spheres.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::super::levels::MAX_LEVELS;
use super::super::walk::Pending;
use super::node::{BLOCK, MovingBlock, MovingNode};
use crate::blocks::{BLOCK_SIZE, WIDTH};
use crate::math::{larger, smaller};
use crate::ray::RayPacket;

/// On every level, all children except one can be on the stack. A tree of one block has a level of its own.
pub(super) const STACK_SIZE: usize = (MAX_LEVELS + 1) * (WIDTH - 1) + 1;

/// Entry distances may be too large, and exit distances too small, by this part.
pub(super) const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Least absolute component of a direction in tests of boxes, so that no distance is infinite times zero.
pub(super) const MIN_COMPONENT: f32 = 1e-18;

/// The inverse of a component of a direction, for tests of boxes.
#[inline(always)]
pub(super) fn inverse(component: f32) -> f32 {
    let is_small = component.abs() < MIN_COMPONENT;
    1.0 / if is_small { MIN_COMPONENT } else { component }
}

/// A ray at its time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayInTime {
    pub origin: [f32; 3],
    pub direction: [f32; 3],
    pub t_min: f32,
    /// Time, from -1/2 to 1/2.
    pub time: f32,
}

impl RayInTime {
    /// The ray in `lane` of `rays`.
    #[inline(always)]
    pub(crate) fn of(rays: &RayPacket, lane: usize) -> Self {
        let vector = |v: &[[f32; 16]; 3]| [v[0][lane], v[1][lane], v[2][lane]];
        Self {
            origin: vector(&rays.origin),
            direction: vector(&rays.direction),
            t_min: rays.t_min[lane],
            time: rays.time[lane],
        }
    }

    /// Distances at which the line of the ray enters and leaves each sphere of a block; NaN if it does not.
    #[inline(always)]
    pub(super) fn chords(&self, block: &MovingBlock) -> [[f32; BLOCK_SIZE]; 2] {
        let (o, d) = (&self.origin, &self.direction);
        let mut ends = [[0.0; BLOCK_SIZE]; 2];
        for i in 0..BLOCK_SIZE {
            let mut to_center = [0.0; 3];
            for axis in 0..3 {
                let center = block.center[axis][i] + self.time * block.displacement[axis][i];
                to_center[axis] = center - o[axis];
            }
            let middle = to_center[0] * d[0] + to_center[1] * d[1] + to_center[2] * d[2];
            // Subtract squares only after the component along the ray is removed, for distant spheres
            let across = [
                to_center[0] - middle * d[0],
                to_center[1] - middle * d[1],
                to_center[2] - middle * d[2],
            ];
            let distance2 = across[0] * across[0] + across[1] * across[1] + across[2] * across[2];
            let half = (block.radius[i] * block.radius[i] - distance2).sqrt();
            ends[0][i] = middle - half;
            ends[1][i] = middle + half;
        }
        ends
    }

    /// Distance of the first intersection with each sphere of a block from `t_min` on; infinite without one.
    #[inline(always)]
    pub(super) fn distances(&self, block: &MovingBlock) -> [f32; BLOCK_SIZE] {
        let [near, far] = self.chords(block);
        let mut t = [f32::INFINITY; BLOCK_SIZE];
        for i in 0..BLOCK_SIZE {
            let leaving = if far[i] >= self.t_min { far[i] } else { t[i] };
            t[i] = if near[i] >= self.t_min { near[i] } else { leaving };
        }
        t
    }

    /// Entry distances of the boxes of `node`; infinite for boxes that the ray does not enter before `limit`.
    #[inline(always)]
    fn entries(&self, node: &MovingNode, inverse: &[f32; 3], limit: f32) -> [f32; WIDTH] {
        let (mut enter, mut exit) = ([self.t_min; WIDTH], [limit; WIDTH]);
        for axis in 0..3 {
            let is_negative = usize::from(inverse[axis] < 0.0);
            let (near, far) = (is_negative, 1 - is_negative);
            let at = |side: usize, i: usize| {
                let plane = node.planes[side][axis][i] + self.time * node.changes[side][axis][i];
                (plane - self.origin[axis]) * inverse[axis]
            };
            for i in 0..WIDTH {
                enter[i] = larger(at(near, i), enter[i]);
                exit[i] = smaller(at(far, i), exit[i]);
            }
        }
        for i in 0..WIDTH {
            let is_entered = enter[i] * (1.0 - ROUNDING) <= exit[i] * (1.0 + ROUNDING);
            enter[i] = if is_entered { enter[i] } else { f32::INFINITY };
        }
        enter
    }
}

/// Memory of a traversal, which can be used for one after another.
pub(super) struct RayStack([Pending; STACK_SIZE]);

impl RayStack {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self([Pending::default(); STACK_SIZE])
    }
}

/// Calls `visit` for the blocks below `code` whose boxes `ray` enters before `limit`, nearest boxes first. `visit`
/// returns the new limit; a negative one ends the traversal.
#[inline(always)]
pub(super) fn walk_blocks(
    nodes: &[MovingNode],
    mut code: u32,
    ray: &RayInTime,
    RayStack(stack): &mut RayStack,
    mut limit: f32,
    mut visit: impl FnMut(usize, f32) -> f32,
) {
    let [x, y, z] = ray.direction;
    let inverse = [inverse(x), inverse(y), inverse(z)];
    let mut depth = 0;
    loop {
        if code & BLOCK != 0 {
            limit = visit((code & !BLOCK) as usize, limit);
            if limit < 0.0 {
                return;
            }
        } else {
            // Push the children, farthest first
            let node = &nodes[code as usize];
            let enter = ray.entries(node, &inverse, limit);
            let first = depth;
            for i in 0..WIDTH {
                if enter[i] < f32::INFINITY {
                    let pending = Pending::new(larger(enter[i], 0.0).to_bits(), node.children[i]);
                    let mut place = depth;
                    while place > first && stack[place - 1] < pending {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = pending;
                    depth += 1;
                }
            }
        }
        // Continue with the nearest node or block that begins before the limit
        loop {
            if depth == 0 {
                return;
            }
            depth -= 1;
            let (enter, next) = stack[depth].split();
            if enter * (1.0 - ROUNDING) <= limit {
                code = next;
                break;
            }
        }
    }
}
