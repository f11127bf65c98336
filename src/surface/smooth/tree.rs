//! Bricks in a sparse tree of 4x4x4 children a node, and the way of a ray through it.
//!
//! A child is a brick (or a node of bricks) that the surface passes, or uniform: outside, or deep inside.
//! Empty space costs a step for each of the largest uniform cells on the way, however far particles escaped.

use glam::Vec3;

use super::brick::{Brick, VOXELS, VOXELS_I32, VOXELS_U32, corner, voxel_of};
use super::root::first_crossing;
use crate::ray::Ray;
use crate::surface::Side;

/// Bits of a coordinate that a level takes.
const LEVEL_BITS: u32 = 2;
/// More levels than coordinates have bits for.
const MAX_LEVELS: u32 = 12;
/// Components of directions are kept this far from zero, so that their inverses are finite.
const MIN_DIRECTION: f32 = 1e-9;

/// 64 cells.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Node {
    /// Cells that have a child: a bit each, x fastest, then y, then z.
    pub(super) children: u64,
    /// Of the others, those that are inside.
    pub(super) inside: u64,
    /// Number of the first child; the others follow in the order of bits.
    pub(super) first: u32,
}

impl Node {
    #[inline(always)]
    fn child(&self, cell: u32) -> u32 {
        let before = self.children & ((1_u64 << cell) - 1);
        self.first + before.count_ones()
    }
}

/// A block of 4x4x4 bricks that are not all outside.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// In blocks.
    pub(super) place: [i32; 3],
    /// Its children are bricks.
    pub(super) node: Node,
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct BrickTree {
    nodes: Vec<Node>,
    root: u32,
    /// Levels of nodes.
    levels: u32,
    pub(super) bricks: Vec<Brick>,
    /// Edge of a voxel.
    voxel: f32,
    inverse: f32,
    /// The corner of the root.
    origin: Vec3,
    /// Box of all that is not outside, in voxels from there.
    low: Vec3,
    high: Vec3,
    /// The surface, in codes.
    threshold: f32,
}

/// Where a ray comes to the other side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    pub(super) t: f32,
    /// The brick and the place in it, in voxels; none where a uniform cell begins against expectation.
    pub(super) brick: Option<(u32, Vec3)>,
}

/// A ray in voxels from the root's corner; distances stay those of the ray.
struct Line {
    origin: Vec3,
    direction: Vec3,
    inverse: Vec3,
}

impl BrickTree {
    /// Puts `blocks` and their `bricks` under one root. A block's children are numbered from its `first` on.
    pub(super) fn new(
        mut blocks: Vec<Block>,
        bricks: Vec<Brick>,
        voxel: f32,
        threshold: f32,
    ) -> Self {
        let Some(first) = blocks.first() else {
            return Self {
                voxel,
                inverse: 1.0 / voxel,
                threshold,
                ..Self::default()
            };
        };
        let (mut low, mut high) = (first.place, first.place);
        for block in &blocks {
            for axis in 0..3 {
                low[axis] = low[axis].min(block.place[axis]);
                high[axis] = high[axis].max(block.place[axis]);
            }
        }
        let extent = (0..3).map(|a| high[a].abs_diff(low[a])).max().unwrap_or(0);
        let bits = u32::BITS - extent.leading_zeros();
        let levels = 1 + bits.div_ceil(LEVEL_BITS);
        let key =
            |block: &Block| order_key(std::array::from_fn(|a| block.place[a].abs_diff(low[a])));
        blocks.sort_unstable_by_key(key);
        let mut nodes: Vec<Node> = blocks.iter().map(|block| block.node).collect();
        let mut keys: Vec<u128> = blocks.iter().map(key).collect();
        let mut first_of_level = 0;
        for _ in 1..levels {
            let (parents, parent_keys) = parents(&keys, first_of_level);
            first_of_level = nodes.len();
            nodes.extend(parents);
            keys = parent_keys;
        }
        let edge = (4 * VOXELS) as f32;
        let place = |p: [i32; 3]| Vec3::from_array(p.map(|c| c as f32));
        let mut tree = Self {
            root: index_u32(first_of_level),
            nodes,
            levels,
            bricks,
            voxel,
            inverse: 1.0 / voxel,
            origin: place(low) * edge * voxel,
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            threshold,
        };
        for block in &blocks {
            tree.enclose(place(block.place) - place(low), &block.node);
        }
        tree
    }

    /// Widens the box by the bricks of a node at a place in blocks.
    fn enclose(&mut self, place: Vec3, node: &Node) {
        let cells = node.children | node.inside;
        for cell in (0..64).filter(|cell| cells >> cell & 1 == 1) {
            let part = corner([cell & 3, cell >> 2 & 3, cell >> 4]);
            let corner = (4.0 * place + part) * VOXELS as f32;
            self.low = self.low.min(corner);
            self.high = self.high.max(corner + VOXELS as f32);
        }
    }

    /// Whether there is no surface.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    pub(super) fn voxel(&self) -> f32 {
        self.voxel
    }

    pub(super) fn byte_len(&self) -> u64 {
        (size_of_val(&self.nodes[..]) + size_of_val(&self.bricks[..])) as u64
    }

    /// Box of all that is not outside.
    pub(super) fn bounds(&self) -> [Vec3; 2] {
        [self.low, self.high].map(|p| self.origin + p * self.voxel)
    }

    /// Where `point` is.
    pub(super) fn side_of(&self, point: Vec3) -> Side {
        let place = (point - self.origin) * self.inverse;
        if !(place.cmpge(self.low).all() && place.cmplt(self.high).all()) {
            return Side::Outside;
        }
        let cell = brick_at(place);
        let (mut node, mut level) = (self.root, self.levels - 1);
        loop {
            let n = &self.nodes[node as usize];
            let bit = bit_of(cell, level);
            if n.children >> bit & 1 == 0 {
                return side(n.inside >> bit & 1 == 1);
            }
            node = n.child(bit);
            if level == 0 {
                let base = Vec3::from_array(cell.map(|c| (c * VOXELS_U32) as f32));
                let value = self.bricks[node as usize].value(place - base);
                return side(value >= self.threshold);
            }
            level -= 1;
        }
    }

    /// The first place where a ray on `from` comes to the other side.
    #[inline(always)]
    pub(super) fn first_crossing(&self, ray: &Ray, from: Side) -> Option<Meeting> {
        let line = Line::new(ray, self.origin, self.inverse);
        let near = (self.low - line.origin) * line.inverse;
        let far = (self.high - line.origin) * line.inverse;
        let t_in = near.min(far).max_element().max(ray.t_min);
        let t_out = near.max(far).min_element().min(ray.t_max);
        // Also without bricks.
        if t_in.partial_cmp(&t_out).is_none_or(|order| order.is_ge()) {
            return None;
        }
        let top = self.levels - 1;
        let mut level = top;
        let mut nodes = [0_u32; MAX_LEVELS as usize];
        nodes[top as usize] = self.root;
        let mut t = t_in;
        let mut cell = {
            let last = (self.high - 1.0).max(self.low);
            brick_at((line.origin + line.direction * t).clamp(self.low, last))
        };
        loop {
            // Down to the largest uniform cell, or a brick.
            let mut brick = None;
            let node = loop {
                let node = &self.nodes[nodes[level as usize] as usize];
                let bit = bit_of(cell, level);
                if node.children >> bit & 1 == 0 {
                    break node;
                }
                let child = node.child(bit);
                if level == 0 {
                    brick = Some(child);
                    break node;
                }
                level -= 1;
                nodes[level as usize] = child;
            };
            let size = 1_u32 << (LEVEL_BITS * level);
            let corner = cell.map(|c| c & !(size - 1));
            let (t_exit, axis) = line.exit(corner, size);
            let until = t_exit.min(t_out);
            if let Some(brick) = brick {
                let base = Vec3::from_array(corner.map(|c| (c * VOXELS_U32) as f32));
                let local = line.origin - base;
                let found =
                    self.in_brick(&self.bricks[brick as usize], &line, local, t, until, from);
                if let Some(t) = found {
                    let place = local + line.direction * t;
                    return Some(Meeting {
                        t,
                        brick: Some((brick, place)),
                    });
                }
            } else if side(node.inside >> bit_of(cell, level) & 1 == 1) != from {
                return Some(Meeting { t, brick: None });
            }
            if t_exit >= t_out {
                return None;
            }
            t = t.max(t_exit);
            let next = line.next_cell(t, axis, corner, size)?;
            let changed = (0..3).fold(0, |bits, a| bits | (cell[a] ^ next[a]));
            let up = (u32::BITS - 1 - changed.leading_zeros().min(u32::BITS - 1)) / LEVEL_BITS;
            if up > top {
                return None;
            }
            level = level.max(up);
            cell = next;
        }
    }

    /// The distance in `t..until` where the ray first comes to the other side in `brick`; `local` is the
    /// ray's origin in voxels from the brick's corner.
    #[inline(always)]
    fn in_brick(
        &self,
        brick: &Brick,
        line: &Line,
        local: Vec3,
        mut t: f32,
        until: f32,
        from: Side,
    ) -> Option<f32> {
        let sign = match from {
            Side::Outside => 1.0,
            Side::Inside => -1.0,
        };
        let voxels = brick.voxels(from);
        let mut voxel = voxel_of(local + line.direction * t);
        let ahead = Vec3::select(line.direction.cmpge(Vec3::ZERO), Vec3::ONE, Vec3::ZERO);
        let mut next = (corner(voxel) + ahead - local) * line.inverse;
        let step = line.inverse.abs();
        loop {
            let nearest = next.min_element();
            let end = nearest.min(until);
            #[expect(clippy::cast_sign_loss, reason = "voxels are from 0 to 7")]
            let is_marked = voxels[voxel[2] as usize] >> (8 * voxel[1] + voxel[0]) & 1 == 1;
            if is_marked {
                let corners = brick.corners(voxel[0], voxel[1], voxel[2]);
                let from = local + line.direction * t - corner(voxel);
                let to = local + line.direction * end - corner(voxel);
                let part = first_crossing(&corners, from, to, self.threshold, sign);
                if let Some(part) = part {
                    return Some(t + part * (end - t).max(0.0));
                }
            }
            if nearest >= until {
                return None;
            }
            t = t.max(nearest);
            let axis = line.axis_of(next, nearest);
            voxel[axis] += if line.direction[axis] >= 0.0 { 1 } else { -1 };
            if !(0..VOXELS_I32).contains(&voxel[axis]) {
                return None;
            }
            next[axis] += step[axis];
        }
    }
}

impl Line {
    #[inline(always)]
    fn new(ray: &Ray, origin: Vec3, inverse_voxel: f32) -> Self {
        let direction = ray.direction * inverse_voxel;
        let away = direction.map(|d| {
            if d.abs() < MIN_DIRECTION {
                MIN_DIRECTION.copysign(d)
            } else {
                d
            }
        });
        Self {
            origin: (ray.origin - origin) * inverse_voxel,
            direction,
            inverse: away.recip(),
        }
    }

    /// Where the ray leaves a cell of `size` bricks, and along which axis.
    #[inline(always)]
    fn exit(&self, cell: [u32; 3], size: u32) -> (f32, usize) {
        let bound = |axis: usize| {
            let beyond = if self.direction[axis] >= 0.0 { size } else { 0 };
            ((cell[axis] + beyond) * VOXELS_U32) as f32
        };
        let t = (Vec3::new(bound(0), bound(1), bound(2)) - self.origin) * self.inverse;
        let nearest = t.min_element();
        (nearest, self.axis_of(t, nearest))
    }

    #[inline(always)]
    fn axis_of(&self, t: Vec3, nearest: f32) -> usize {
        if t.x == nearest {
            0
        } else if t.y == nearest {
            1
        } else {
            2
        }
    }

    /// The brick beyond a cell that is left at `t` along `axis`: along the other axes it stays beside that cell,
    /// however `t` is rounded.
    #[inline(always)]
    fn next_cell(&self, t: f32, axis: usize, cell: [u32; 3], size: u32) -> Option<[u32; 3]> {
        let mut next = brick_at(self.origin + self.direction * t);
        for a in 0..3 {
            next[a] = next[a].clamp(cell[a], cell[a] + size - 1);
        }
        next[axis] = if self.direction[axis] >= 0.0 {
            cell[axis] + size
        } else {
            cell[axis].checked_sub(1)?
        };
        Some(next)
    }
}

/// The brick at a place in voxels.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates at 0, where the tree begins"
)]
fn brick_at(place: Vec3) -> [u32; 3] {
    [place.x, place.y, place.z].map(|x| (x.max(0.0) as i32 as u32) / VOXELS_U32)
}

/// The bit of a brick's cell in its node of `level`.
#[inline(always)]
fn bit_of(cell: [u32; 3], level: u32) -> u32 {
    let part = |c: u32| c >> (LEVEL_BITS * level) & 3;
    part(cell[0]) | part(cell[1]) << 2 | part(cell[2]) << 4
}

#[inline(always)]
fn side(inside: bool) -> Side {
    if inside { Side::Inside } else { Side::Outside }
}

/// Order in which the children of each node are neighbours: six bits a level.
fn order_key(place: [u32; 3]) -> u128 {
    (0..MAX_LEVELS - 1).fold(0, |key, level| {
        let digit = u128::from(bit_of(place, level));
        key | digit << (3 * LEVEL_BITS * level)
    })
}

/// The nodes above those with these keys, of which the first has number `first`, and their keys.
fn parents(keys: &[u128], first: usize) -> (Vec<Node>, Vec<u128>) {
    let (mut nodes, mut parents): (Vec<Node>, Vec<u128>) = (Vec::new(), Vec::new());
    for (number, key) in (first..).zip(keys) {
        if parents.last() != Some(&(key >> 6)) {
            parents.push(key >> 6);
            nodes.push(Node {
                first: index_u32(number),
                ..Node::default()
            });
        }
        if let Some(node) = nodes.last_mut() {
            node.children |= 1 << (key & 63);
        }
    }
    (nodes, parents)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "bricks are counted in 32 bits"
)]
fn index_u32(index: usize) -> u32 {
    index as u32
}
