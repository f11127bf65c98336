//! Packs the leaves of a binary tree into blocks.
//!
//! The test of a block costs the same whether it is full or not. So a subtree that fits into one block becomes one,
//! unless the surface area heuristic prefers to keep it apart. The result is in depth-first order: every subtree is a
//! range of blocks.

use super::Aabb;
use super::binary::{BinaryNode, BinaryTree};
use crate::order::index_u32;

/// A binary tree over blocks.
#[derive(Debug, Default)]
pub(super) struct PackedTree {
    /// Root first, children after their parents; empty without blocks.
    pub(super) nodes: Vec<PackedNode>,
    /// Index of the first member of each block, and the total number of members at the end.
    pub(super) starts: Vec<u32>,
    /// The references in the blocks.
    pub(super) members: Vec<u32>,
    /// Box of the node that each block was made from; empty unless requested.
    pub(super) boxes: Vec<Aabb>,
}

/// A node of a [`PackedTree`].
#[derive(Debug, Clone, Copy)]
pub(super) struct PackedNode {
    /// Surface area as a fraction of the area of the root, which is the probability that a ray through the root box
    /// enters this one.
    pub(super) area: f32,
    /// Index of the left child, which the right child follows; 0 for leaves.
    pub(super) child: u32,
    /// Index of the first block in the subtree.
    pub(super) first: u32,
    /// Number of blocks in the subtree; a leaf has several if its references do not fit into one.
    pub(super) count: u32,
}

/// Parameters of packing.
#[derive(Debug, Clone, Copy)]
pub(super) struct LeafPacking {
    /// References per block.
    pub(super) capacity: usize,
    /// Length to add to the boxes to get their true area (see `WideTree::padding`).
    pub(super) padding: f32,
    /// Whether to store the boxes of the nodes that blocks were made from.
    pub(super) keep_boxes: bool,
}

/// Cost of a subtree.
#[derive(Debug, Clone, Copy, Default)]
struct Cost {
    /// Minimum expected number of tests for a ray that enters the root.
    tests: f32,
    /// Number of references; saturates.
    references: u16,
    /// Whether a single block is cheapest.
    is_block: bool,
}

/// Cost of keeping two subtrees apart, in units of box tests: their slots in a node and their memory. With 1/7, the
/// share of a slot in a node alone, blocks are equally fast and use 6 % more memory (clustered particles of the
/// thesis's box, 1e6).
const SPLIT_COST: f32 = 0.5;

impl PackedTree {
    /// Converts `binary` to a tree of blocks.
    pub(super) fn new(binary: &BinaryTree, packing: LeafPacking) -> Self {
        let mut packed = Self::default();
        if binary.nodes.is_empty() {
            return packed;
        }
        // Find the subtrees that become blocks
        let costs = costs(binary, packing);
        let areas = Areas::of(binary, packing.padding);
        packed.members.reserve_exact(binary.references.len());
        // Reserve upper bounds: growing vectors would take up to three times as much memory.
        packed.nodes.reserve_exact(binary.nodes.len());
        packed.starts.reserve_exact(binary.references.len() + 1);
        // Copy the nodes depth first, and fill the blocks
        packed.nodes.push(packed.leaf());
        let mut pending = vec![(0_u32, 0_u32)];
        while let Some((index, target)) = pending.pop() {
            let node = &binary.nodes[index as usize];
            let mut packed_node = packed.leaf();
            packed_node.area = areas.fraction(node);
            if node.is_leaf() || costs[index as usize].is_block {
                packed.add_blocks(binary, index, packing);
            } else {
                packed_node.child = index_u32(packed.nodes.len());
                packed.nodes.extend([packed_node; 2]);
                // The left child is popped first, so that blocks are in depth-first order.
                pending.push((node.first + 1, packed_node.child + 1));
                pending.push((node.first, packed_node.child));
            }
            packed_node.count = packed.block_count() - packed_node.first;
            packed.nodes[target as usize] = packed_node;
        }
        // Complete the block counts from the leaves up, and release unused memory
        packed.starts.push(index_u32(packed.members.len()));
        packed.count_blocks();
        packed.nodes.shrink_to_fit();
        packed.starts.shrink_to_fit();
        packed
    }

    /// The references of `block`.
    pub(super) fn members(&self, block: u32) -> &[u32] {
        let block = block as usize;
        &self.members[self.starts[block] as usize..self.starts[block + 1] as usize]
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.nodes[..])
            + size_of_val(&self.starts[..])
            + size_of_val(&self.members[..])
            + size_of_val(&self.boxes[..])) as u64
    }

    fn block_count(&self) -> u32 {
        index_u32(self.starts.len())
    }

    fn leaf(&self) -> PackedNode {
        PackedNode { area: 0.0, child: 0, first: self.block_count(), count: 0 }
    }

    /// Adds the subtree of node `index` as one block, or as several blocks if it is a leaf that is too large for one.
    fn add_blocks(&mut self, binary: &BinaryTree, index: u32, packing: LeafPacking) {
        let node = &binary.nodes[index as usize];
        if node.is_leaf() {
            for block in references(binary, node).chunks(packing.capacity) {
                self.start_block(node, packing);
                self.members.extend_from_slice(block);
            }
            return;
        }
        self.start_block(node, packing);
        // Collect the references of all leaves in the subtree
        let begin = self.members.len();
        let mut pending = vec![index];
        while let Some(index) = pending.pop() {
            let node = &binary.nodes[index as usize];
            if node.is_leaf() {
                self.members.extend_from_slice(references(binary, node));
            } else {
                pending.extend([node.first + 1, node.first]);
            }
        }
        remove_duplicates(&mut self.members, begin);
    }

    fn start_block(&mut self, node: &BinaryNode, packing: LeafPacking) {
        self.starts.push(index_u32(self.members.len()));
        if packing.keep_boxes {
            self.boxes.push(node.bounds);
        }
    }

    fn count_blocks(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            let child = self.nodes[index].child as usize;
            if child > 0 {
                self.nodes[index].count = self.nodes[child].count + self.nodes[child + 1].count;
            }
        }
    }
}

/// The references of a leaf.
fn references<'a>(binary: &'a BinaryTree, leaf: &BinaryNode) -> &'a [u32] {
    &binary.references[leaf.first as usize..][..leaf.count as usize]
}

/// Removes duplicates: leaves of one subtree may share particles that a spatial split has cut, but one block needs
/// them only once.
fn remove_duplicates(members: &mut Vec<u32>, begin: usize) {
    members[begin..].sort_unstable();
    let mut len = begin;
    for from in begin..members.len() {
        if len == begin || members[len - 1] != members[from] {
            members[len] = members[from];
            len += 1;
        }
    }
    members.truncate(len);
}

/// Decides from the leaves up which subtrees become one block. Finds the cheapest cut of the tree into leaves by
/// dynamic programming, with the costs of Goldsmith & Salmon (1987).
fn costs(binary: &BinaryTree, packing: LeafPacking) -> Vec<Cost> {
    let areas = Areas::of(binary, packing.padding);
    let mut costs = vec![Cost::default(); binary.nodes.len()];
    for (index, node) in binary.nodes.iter().enumerate().rev() {
        let area = areas.fraction(node);
        // Compute the cost of the subtree as it is
        let (references, apart) = if node.is_leaf() {
            let blocks = (node.count as usize).div_ceil(packing.capacity);
            let references = u16::try_from(node.count).unwrap_or(u16::MAX);
            (references, area * blocks as f32)
        } else {
            let [a, b] = [0, 1].map(|side| costs[node.first as usize + side]);
            let references = a.references.saturating_add(b.references);
            (references, a.tests + b.tests + area * SPLIT_COST)
        };
        // Compare with the cost of a single block
        let is_block = usize::from(references) <= packing.capacity && area <= apart;
        costs[index] = Cost { tests: if is_block { area } else { apart }, references, is_block };
    }
    costs
}

/// Surface areas as fractions of the area of the root.
#[derive(Debug, Clone, Copy)]
struct Areas {
    padding: f32,
    root: f64,
}

impl Areas {
    fn of(binary: &BinaryTree, padding: f32) -> Self {
        let root = binary.nodes.first().map_or(0.0, |root| root.bounds.padded(padding).area());
        Self { padding, root }
    }

    #[expect(clippy::cast_possible_truncation, reason = "only compared")]
    fn fraction(&self, node: &BinaryNode) -> f32 {
        if self.root > 0.0 {
            (node.bounds.padded(self.padding).area() / self.root) as f32
        } else {
            0.0
        }
    }
}
