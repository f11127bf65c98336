//! Bricks in a sparse tree of 4x4x4 children a node, and the way of a ray through it.
//!
//! A child is a brick (or a node of bricks) that the surface passes, or uniform: outside, or deep inside.
//! Empty space costs a step for each of the largest uniform cells on the way, however far particles escaped.

use glam::{Vec3, Vec3A};
use spherule_formats::order::index_u32;

use super::brick::{Brick, VOXEL_BITS, VOXELS, corner, voxel_of};
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

/// A cell that is not outside.
#[derive(Debug, Clone, Copy)]
enum Cell {
    /// All of it is inside.
    Inside,
    /// There is more to say of it.
    Node(Node),
}

impl Cell {
    fn of(node: Node) -> Self {
        if node.inside == !0 {
            Self::Inside
        } else {
            Self::Node(node)
        }
    }

    fn node(self) -> Node {
        match self {
            Self::Inside => Node {
                inside: !0,
                ..Node::default()
            },
            Self::Node(node) => node,
        }
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
    low: Vec3A,
    high: Vec3A,
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
    origin: Vec3A,
    direction: Vec3A,
    inverse: Vec3A,
    /// 1 along axes that it goes up, else 0: where it leaves a cell.
    ahead: Vec3A,
    /// 1 along axes that it goes up, else -1.
    step: Vec3A,
    /// What stepping along some axes, a bit each, adds to the number of a voxel.
    steps: [i32; 8],
}

impl BrickTree {
    /// Puts `blocks` and their `bricks` under one root. A block's children are numbered from its `first` on.
    pub(super) fn new(blocks: &[Block], bricks: Vec<Brick>, voxel: f32, threshold: f32) -> Self {
        let mut tree = Self {
            bricks,
            voxel,
            inverse: 1.0 / voxel,
            low: Vec3A::INFINITY,
            high: Vec3A::NEG_INFINITY,
            threshold,
            ..Self::default()
        };
        let Some(first) = blocks.first() else {
            return tree;
        };
        let (mut low, mut high) = (first.place, first.place);
        for block in blocks {
            for axis in 0..3 {
                low[axis] = low[axis].min(block.place[axis]);
                high[axis] = high[axis].max(block.place[axis]);
            }
        }
        let edge = (4 * VOXELS) as f32;
        tree.origin = Vec3::from(vector(low)) * edge * voxel;
        for block in blocks {
            tree.enclose(vector(block.place) - vector(low), &block.node);
        }
        let extent = (0..3).map(|a| high[a].abs_diff(low[a])).max().unwrap_or(0);
        let bits = u32::BITS - extent.leading_zeros();
        let place = |block: &Block| std::array::from_fn(|a| block.place[a] - low[a]);
        let mut cells: Vec<(u128, Cell)> = blocks
            .iter()
            .map(|block| (order_key(place(block)), Cell::of(block.node)))
            .collect();
        cells.sort_unstable_by_key(|(key, _)| *key);
        // Of blocks, and of each level above.
        tree.levels = 1 + bits.div_ceil(LEVEL_BITS);
        for _ in 1..tree.levels {
            cells = tree.level_above(&cells);
        }
        let root = cells.first().map(|(_, cell)| cell.node());
        tree.root = index_u32(tree.nodes.len());
        tree.nodes.extend(root);
        tree
    }

    /// Puts the nodes of a level, in order, into the tree, and returns the cells of the level above.
    fn level_above(&mut self, cells: &[(u128, Cell)]) -> Vec<(u128, Cell)> {
        let brothers = cells.chunk_by(|(a, _), (b, _)| a >> 6 == b >> 6);
        brothers
            .map(|brothers| {
                let mut parent = Node {
                    first: index_u32(self.nodes.len()),
                    ..Node::default()
                };
                for (key, cell) in brothers {
                    let bit = 1 << (key & 63);
                    match cell {
                        Cell::Inside => parent.inside |= bit,
                        Cell::Node(node) => {
                            parent.children |= bit;
                            self.nodes.push(*node);
                        }
                    }
                }
                (brothers[0].0 >> 6, Cell::of(parent))
            })
            .collect()
    }

    /// Widens the box by the bricks of a node at a place in blocks.
    fn enclose(&mut self, place: Vec3A, node: &Node) {
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

    /// Where `point` is.
    pub(super) fn side_of(&self, point: Vec3) -> Side {
        let place = Vec3A::from(point - self.origin) * self.inverse;
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
                let base = vector(cell) * VOXELS as f32;
                let value = self.bricks[node as usize].value(Vec3::from(place - base));
                return side(value >= self.threshold);
            }
            level -= 1;
        }
    }

    /// The first place where a ray on `from` comes to the other side.
    #[inline(always)]
    pub(super) fn first_crossing(&self, ray: &Ray, from: Side) -> Option<Meeting> {
        if self.is_empty() {
            return None;
        }
        let line = Line::new(ray, self.origin, self.inverse);
        let near = (self.low - line.origin) * line.inverse;
        let far = (self.high - line.origin) * line.inverse;
        let t_in = near.min(far).max_element().max(ray.t_min);
        let t_out = near.max(far).min_element().min(ray.t_max);
        // Also where there are no numbers.
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
            let (node, bit) = loop {
                let node = &self.nodes[nodes[level as usize] as usize];
                let bit = bit_of(cell, level);
                if node.children >> bit & 1 == 0 {
                    break (node, bit);
                }
                let child = node.child(bit);
                if level == 0 {
                    brick = Some(child);
                    break (node, bit);
                }
                level -= 1;
                nodes[level as usize] = child;
            };
            let size = 1_i32 << (LEVEL_BITS * level);
            let low = cell.map(|c| c & !(size - 1));
            let corner = vector(low) * VOXELS as f32;
            let (t_exit, axes) = line.exit(corner, (size << VOXEL_BITS) as f32);
            if let Some(brick) = brick {
                let local = line.origin - corner;
                let until = t_exit.min(t_out);
                let bricks = &self.bricks[brick as usize];
                if let Some(t) = self.in_brick(bricks, &line, local, t, until, from) {
                    let place = Vec3::from(local + line.direction * t);
                    return Some(Meeting {
                        t,
                        brick: Some((brick, place)),
                    });
                }
            } else if side(node.inside >> bit & 1 == 1) != from {
                return Some(Meeting { t, brick: None });
            }
            if t_exit >= t_out {
                return None;
            }
            t = t.max(t_exit);
            let next = line.next_cell(t, axes, low, size);
            let changed = (0..3).fold(0, |bits, a| bits | (cell[a] ^ next[a]).cast_unsigned());
            // Of places before the root's corner, too, the first bit is another.
            let up = changed.max(1).ilog2() / LEVEL_BITS;
            if up > top {
                return None;
            }
            level = level.max(up);
            cell = next;
        }
    }

    /// The distance in `t..until` where the ray first comes to the other side in `brick`; `local` is the
    /// ray's origin in voxels from the brick's corner.
    ///
    /// Steps from voxel to voxel (Amanatides and Woo 1987) without branches on axes. Where a ray passes an edge it
    /// steps along two axes at once.
    #[inline(always)]
    fn in_brick(
        &self,
        brick: &Brick,
        line: &Line,
        local: Vec3A,
        t: f32,
        until: f32,
        from: Side,
    ) -> Option<f32> {
        let [low, high] = brick.marked(from);
        let near = (low - local) * line.inverse;
        let far = (high - local) * line.inverse;
        let mut t = t.max(near.min(far).max_element());
        // Of planes of voxels, so that the last step ends there.
        let until = until.min(near.max(far).min_element());
        if t > until {
            return None;
        }
        let sign = match from {
            Side::Outside => 1.0,
            Side::Inside => -1.0,
        };
        let voxels = brick.voxels(from);
        let start = (local + line.direction * t).clamp(low, high - 1.0);
        let first = voxel_of(Vec3::from(start));
        let mut number = VoxelNumber::of(first);
        let mut next = (corner(first) + line.ahead - local) * line.inverse;
        let step = line.inverse.abs();
        loop {
            let nearest = next.min_element();
            let [x, y, z] = number.voxel();
            #[expect(clippy::cast_sign_loss, reason = "from 0 to 7")]
            if voxels[z as usize] >> (8 * y + x) & 1 == 1 {
                let end = nearest.min(until).max(t);
                let corner = corner([x, y, z]);
                let place = |t: f32| Vec3::from(local + line.direction * t - corner);
                let corners = brick.corners(x, y, z);
                let part = first_crossing(&corners, place(t), place(end), self.threshold, sign);
                if let Some(part) = part {
                    return Some(t + part * (end - t));
                }
            }
            if nearest >= until {
                return None;
            }
            t = t.max(nearest);
            let stepped = next.cmple(Vec3A::splat(nearest));
            next += Vec3A::select(stepped, step, Vec3A::ZERO);
            number.add(line.steps[stepped.bitmask() as usize & 7]);
            if !number.is_in_brick() {
                return None;
            }
        }
    }
}

/// A voxel of a brick as one number: five bits an axis, its coordinate and 8. One beyond the brick shows by the
/// upper two bits.
#[derive(Clone, Copy)]
struct VoxelNumber(i32);

impl VoxelNumber {
    const BITS: u32 = 5;
    const BEYOND: i32 = 0b11000 * (1 + (1 << Self::BITS) + (1 << (2 * Self::BITS)));
    const WITHIN: i32 = 0b01000 * (1 + (1 << Self::BITS) + (1 << (2 * Self::BITS)));

    #[inline(always)]
    fn of(voxel: [i32; 3]) -> Self {
        Self(Self::WITHIN + Self::step(voxel))
    }

    /// What a step adds.
    #[inline(always)]
    const fn step([x, y, z]: [i32; 3]) -> i32 {
        x + (y << Self::BITS) + (z << (2 * Self::BITS))
    }

    #[inline(always)]
    fn voxel(self) -> [i32; 3] {
        [0, Self::BITS, 2 * Self::BITS].map(|shift| self.0 >> shift & 7)
    }

    #[inline(always)]
    fn add(&mut self, step: i32) {
        self.0 += step;
    }

    #[inline(always)]
    fn is_in_brick(self) -> bool {
        self.0 & Self::BEYOND == Self::WITHIN
    }
}

impl Line {
    #[inline(always)]
    fn new(ray: &Ray, origin: Vec3, inverse_voxel: f32) -> Self {
        let direction = Vec3A::from(ray.direction) * inverse_voxel;
        let away = direction.map(|d| {
            if d.abs() < MIN_DIRECTION {
                MIN_DIRECTION.copysign(d)
            } else {
                d
            }
        });
        let up = away.cmpge(Vec3A::ZERO);
        let step = Vec3A::select(up, Vec3A::ONE, Vec3A::NEG_ONE);
        let bits = up.bitmask();
        let along = |axis: u32, by: i32| if bits >> axis & 1 == 1 { by } else { -by };
        let (x, y, z) = (
            along(0, VoxelNumber::step([1, 0, 0])),
            along(1, VoxelNumber::step([0, 1, 0])),
            along(2, VoxelNumber::step([0, 0, 1])),
        );
        Self {
            origin: Vec3A::from(ray.origin - origin) * inverse_voxel,
            direction,
            inverse: away.recip(),
            ahead: Vec3A::select(up, Vec3A::ONE, Vec3A::ZERO),
            step,
            steps: [0, x, y, x + y, z, z + x, z + y, z + y + x],
        }
    }

    /// Where the ray leaves a cell of `size` bricks at `corner`, and a bit for each axis that it does so along.
    #[inline(always)]
    fn exit(&self, corner: Vec3A, size: f32) -> (f32, u32) {
        let next = (corner + size * self.ahead - self.origin) * self.inverse;
        let nearest = next.min_element();
        (nearest, next.cmple(Vec3A::splat(nearest)).bitmask())
    }

    /// The brick beyond a cell that is left at `t` along `axes`: along the others it stays beside that cell, however
    /// `t` is rounded.
    #[inline(always)]
    fn next_cell(&self, t: f32, axes: u32, cell: [i32; 3], size: i32) -> [i32; 3] {
        let place = (self.origin + self.direction * t).to_array();
        std::array::from_fn(|a| {
            let beside = brick_of(place[a]).clamp(cell[a], cell[a] + size - 1);
            let beyond = if self.step[a] > 0.0 {
                cell[a] + size
            } else {
                cell[a] - 1
            };
            if axes >> a & 1 == 1 { beyond } else { beside }
        })
    }
}

/// The brick at a place in voxels.
#[inline(always)]
fn brick_at(place: Vec3A) -> [i32; 3] {
    place.to_array().map(brick_of)
}

/// The same along one axis; places are from 0 on, but for rounding.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "saturates, and is clamped")]
fn brick_of(place: f32) -> i32 {
    place as i32 >> VOXEL_BITS
}

#[inline(always)]
fn vector(cell: [i32; 3]) -> Vec3A {
    Vec3A::new(cell[0] as f32, cell[1] as f32, cell[2] as f32)
}

/// The bit of a brick's cell in its node of `level`.
#[inline(always)]
fn bit_of(cell: [i32; 3], level: u32) -> u32 {
    let part = |c: i32| c.cast_unsigned() >> (LEVEL_BITS * level) & 3;
    part(cell[0]) | part(cell[1]) << 2 | part(cell[2]) << 4
}

#[inline(always)]
fn side(inside: bool) -> Side {
    if inside { Side::Inside } else { Side::Outside }
}

/// Order in which the children of each node are neighbours: six bits a level.
fn order_key(place: [i32; 3]) -> u128 {
    (0..MAX_LEVELS - 1).fold(0, |key, level| {
        let digit = u128::from(bit_of(place, level));
        key | digit << (3 * LEVEL_BITS * level)
    })
}
