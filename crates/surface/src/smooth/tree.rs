//! Bricks in a sparse tree with 4x4x4 children per node.
//!
//! A child is a brick (or a node of bricks) that the surface passes through, or uniform: outside, or deep inside.
//! Empty space costs one step per largest uniform cell on the path of a ray, however far away outliers are.

use glam::{Vec3, Vec3A};
use spherule_tree::order::index_u32;

use super::brick::{Brick, VOXEL_BITS, VOXELS, corner};
use crate::Side;

/// Bits of a coordinate per level.
pub(super) const LEVEL_BITS: u32 = 2;
/// More levels than the bits of a coordinate allow.
pub(super) const MAX_LEVELS: u32 = 12;

/// A node with 64 cells.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BrickNode {
    /// Cells with a child: one bit each, x fastest, then y, then z.
    pub(super) children: u64,
    /// Cells without a child that are inside.
    pub(super) inside: u64,
    /// Index of the first child; the others follow in the order of the bits.
    pub(super) first: u32,
}

impl BrickNode {
    #[inline(always)]
    pub(super) fn child(&self, cell: u32) -> u32 {
        let before = self.children & ((1_u64 << cell) - 1);
        self.first + before.count_ones()
    }
}

/// A cell that is not uniformly outside.
#[derive(Debug, Clone, Copy)]
enum Cell {
    /// Uniformly inside.
    Inside,
    /// Subdivided.
    BrickNode(BrickNode),
}

impl Cell {
    fn of(node: BrickNode) -> Self {
        if node.inside == !0 { Self::Inside } else { Self::BrickNode(node) }
    }

    fn node(self) -> BrickNode {
        match self {
            Self::Inside => BrickNode { inside: !0, ..BrickNode::default() },
            Self::BrickNode(node) => node,
        }
    }
}

/// A block of 4x4x4 bricks that is not uniformly outside.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// Position in blocks.
    pub(super) position: [i32; 3],
    /// The node of the block; its children are bricks.
    pub(super) node: BrickNode,
}

/// A sparse tree of bricks, see the module.
#[derive(Debug, Default)]
pub(super) struct BrickTree {
    pub(super) nodes: Vec<BrickNode>,
    pub(super) root: u32,
    /// Number of node levels.
    pub(super) levels: u32,
    pub(super) bricks: Vec<Brick>,
    /// Edge of a voxel.
    voxel: f32,
    pub(super) inverse: f32,
    /// The corner of the root.
    pub(super) origin: Vec3,
    /// Lower corner of the bounding box of everything that is not outside, in voxels from `origin`.
    pub(super) low: Vec3A,
    /// Upper corner of that box.
    pub(super) high: Vec3A,
    /// Value of the field at the surface, in codes.
    pub(super) threshold: f32,
}

impl BrickTree {
    /// Builds a tree of `blocks` and their `bricks`. The children of a block are numbered from its `first` on.
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
        // Find the bounding box of all blocks
        let (mut low, mut high) = (first.position, first.position);
        for block in blocks {
            for axis in 0..3 {
                low[axis] = low[axis].min(block.position[axis]);
                high[axis] = high[axis].max(block.position[axis]);
            }
        }
        let edge = (4 * VOXELS) as f32;
        tree.origin = Vec3::from(vector(low)) * edge * voxel;
        for block in blocks {
            tree.enclose(vector(block.position) - vector(low), &block.node);
        }
        // Sort the blocks by their position in the tree
        let extent = (0..3).map(|a| high[a].abs_diff(low[a])).max().unwrap_or(0);
        let bits = u32::BITS - extent.leading_zeros();
        let position = |block: &Block| std::array::from_fn(|a| block.position[a] - low[a]);
        let mut cells: Vec<(u128, Cell)> =
            blocks.iter().map(|block| (order_key(position(block)), Cell::of(block.node))).collect();
        cells.sort_unstable_by_key(|(key, _)| *key);
        // Build level after level, from the blocks up
        tree.levels = 1 + bits.div_ceil(LEVEL_BITS);
        for _ in 1..tree.levels {
            cells = tree.level_above(&cells);
        }
        let root = cells.first().map(|(_, cell)| cell.node());
        tree.root = index_u32(tree.nodes.len());
        tree.nodes.extend(root);
        tree
    }

    /// Appends the nodes of a level, which are sorted, and returns the cells of the level above.
    fn level_above(&mut self, cells: &[(u128, Cell)]) -> Vec<(u128, Cell)> {
        let siblings = cells.chunk_by(|(a, _), (b, _)| a >> 6 == b >> 6);
        siblings
            .map(|siblings| {
                let mut parent =
                    BrickNode { first: index_u32(self.nodes.len()), ..BrickNode::default() };
                for (key, cell) in siblings {
                    let bit = 1 << (key & 63);
                    match cell {
                        Cell::Inside => parent.inside |= bit,
                        Cell::BrickNode(node) => {
                            parent.children |= bit;
                            self.nodes.push(*node);
                        }
                    }
                }
                (siblings[0].0 >> 6, Cell::of(parent))
            })
            .collect()
    }

    /// Extends the box by the bricks of a node at a position in blocks.
    fn enclose(&mut self, position: Vec3A, node: &BrickNode) {
        let cells = node.children | node.inside;
        for cell in (0..64).filter(|cell| cells >> cell & 1 == 1) {
            let part = corner([cell & 3, cell >> 2 & 3, cell >> 4]);
            let corner = (4.0 * position + part) * VOXELS as f32;
            self.low = self.low.min(corner);
            self.high = self.high.max(corner + VOXELS as f32);
        }
    }

    /// Whether the tree has no nodes.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    pub(super) fn voxel(&self) -> f32 {
        self.voxel
    }

    pub(super) fn byte_len(&self) -> u64 {
        (size_of_val(&self.nodes[..]) + size_of_val(&self.bricks[..])) as u64
    }

    /// The side on which `point` is.
    pub(super) fn side_of(&self, point: Vec3) -> Side {
        // Points outside the box are outside the body
        let position = Vec3A::from(point - self.origin) * self.inverse;
        if !(position.cmpge(self.low).all() && position.cmplt(self.high).all()) {
            return Side::Outside;
        }
        let cell = brick_at(position);
        let (mut node, mut level) = (self.root, self.levels - 1);
        loop {
            // Stop at a uniform cell
            let n = &self.nodes[node as usize];
            let bit = bit_of(cell, level);
            if n.children >> bit & 1 == 0 {
                return side(n.inside >> bit & 1 == 1);
            }
            // Descend; interpolate the field in a brick
            node = n.child(bit);
            if level == 0 {
                let base = vector(cell) * VOXELS as f32;
                let value = self.bricks[node as usize].value(Vec3::from(position - base));
                return side(value >= self.threshold);
            }
            level -= 1;
        }
    }
}

/// The brick at a position in voxels.
#[inline(always)]
fn brick_at(position: Vec3A) -> [i32; 3] {
    position.to_array().map(brick_of)
}

/// The same along one axis; positions are not negative, except for rounding.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "saturates, and is clamped")]
fn brick_of(position: f32) -> i32 {
    position as i32 >> VOXEL_BITS
}

#[inline(always)]
fn vector(cell: [i32; 3]) -> Vec3A {
    Vec3A::new(cell[0] as f32, cell[1] as f32, cell[2] as f32)
}

/// The bit of the cell of a brick in its node of `level`.
#[inline(always)]
pub(super) fn bit_of(cell: [i32; 3], level: u32) -> u32 {
    let part = |c: i32| c.cast_unsigned() >> (LEVEL_BITS * level) & 3;
    part(cell[0]) | part(cell[1]) << 2 | part(cell[2]) << 4
}

#[inline(always)]
fn side(inside: bool) -> Side {
    if inside { Side::Inside } else { Side::Outside }
}

/// Sort key in which the children of each node are adjacent: six bits per level.
fn order_key(position: [i32; 3]) -> u128 {
    (0..MAX_LEVELS - 1).fold(0, |key, level| {
        let digit = u128::from(bit_of(position, level));
        key | digit << (3 * LEVEL_BITS * level)
    })
}
