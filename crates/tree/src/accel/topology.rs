//! Topology of a tree: the positions of the children of a node. Trees of complete levels compute them, trees of any
//! other shape store links.
//!
//! A traversal refers to nodes and blocks by 32-bit codes that only the topology interprets, so one traversal serves
//! all trees.

use bytemuck::{Pod, Zeroable};

use crate::blocks::{Node, WIDTH};

/// The node or block that a code refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NodeRef<N> {
    /// A node.
    Node(N),
    /// A block, by its index.
    Block(usize),
}

/// The topology of a tree.
pub(super) trait Topology<'a>: Copy + Sync {
    /// The children of a node, before one of them is chosen.
    type Children: Copy;

    /// Code of the root.
    const ROOT: u32 = 0;

    /// The node or block that `code` refers to.
    fn resolve(self, code: u32) -> NodeRef<&'a Node>;

    /// The children of the node with `code`.
    fn children(self, code: u32) -> Self::Children;

    /// Code of the child in `slot`, which is less than eight.
    fn child(self, children: Self::Children, slot: u32) -> u32;
}

/// Number of levels that a code of an implicit tree can represent.
pub(super) const LEVEL_CODES: usize = 16;

/// Bits below the level in a code of an implicit tree, and bits of a node index in a link.
const INDEX_BITS: u32 = 28;
const INDEX_MASK: u32 = (1 << INDEX_BITS) - 1;
/// Number of nodes or blocks that a code can represent.
pub(super) const MAX_INDEX: usize = 1 << INDEX_BITS;
const _: () = assert!(LEVEL_CODES == 1 << (u32::BITS - INDEX_BITS));

/// Complete levels: child `c` of node `i` is node `8 i + c` on the next level, except on one level, which is mapped.
/// A code has the level in its upper bits, and the index in the level below them.
#[derive(Clone, Copy)]
pub(super) struct Implicit<'a> {
    pub(super) levels: &'a [&'a [Node]; LEVEL_CODES],
    pub(super) depth: u32,
    pub(super) mapped_level: u32,
    pub(super) mapped: &'a [u32],
}

impl<'a> Implicit<'a> {
    /// Index of the first child of node `index` on `level`, among the nodes or blocks of the next level.
    #[inline(always)]
    pub(super) fn first_child(self, level: u32, index: usize) -> usize {
        if level == self.mapped_level { self.mapped[index] as usize * WIDTH } else { index * WIDTH }
    }
}

impl<'a> Topology<'a> for Implicit<'a> {
    /// The code of the first child.
    type Children = u32;

    #[inline(always)]
    fn resolve(self, code: u32) -> NodeRef<&'a Node> {
        let (level, index) = (code >> INDEX_BITS, (code & INDEX_MASK) as usize);
        if level == self.depth {
            NodeRef::Block(index)
        } else {
            NodeRef::Node(&self.levels[level as usize][index])
        }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^28 blocks")]
    fn children(self, code: u32) -> u32 {
        let (level, index) = (code >> INDEX_BITS, (code & INDEX_MASK) as usize);
        let first = self.first_child(level, index) as u32;
        ((level + 1) << INDEX_BITS) | first
    }

    #[inline(always)]
    fn child(self, first: u32, slot: u32) -> u32 {
        first + slot
    }
}

/// Positions of the children of one node. They are contiguous in slot order: nodes first, then blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Link {
    /// Number of children that are nodes in the upper four bits, index of the first one below them.
    nodes: u32,
    /// Index of the first child that is a block.
    first_block: u32,
}

impl Link {
    /// The first `node_count` slots are nodes from `first_node` on, the other slots are blocks from `first_block` on.
    ///
    /// # Panics
    /// If an index is too large for its bits.
    #[expect(clippy::cast_possible_truncation, reason = "checked just above")]
    pub(super) fn new(first_node: usize, node_count: usize, first_block: usize) -> Self {
        assert!(
            first_node < MAX_INDEX && first_block < MAX_INDEX && node_count <= WIDTH,
            "a tree with links holds fewer than 2^28 nodes and blocks"
        );
        Self {
            nodes: ((node_count as u32) << INDEX_BITS) | first_node as u32,
            first_block: first_block as u32,
        }
    }

    /// Number of children that are nodes.
    pub(super) fn node_count(self) -> usize {
        (self.nodes >> INDEX_BITS) as usize
    }

    /// Index of the first child that is a node.
    pub(super) fn first_node(self) -> usize {
        (self.nodes & INDEX_MASK) as usize
    }

    /// Index of the first child that is a block.
    pub(super) fn first_block(self) -> usize {
        self.first_block as usize
    }
}

/// The bit that is set in codes of blocks.
const BLOCK: u32 = 1 << 31;

/// Any topology, with one link per node. A code is the index of a node, or the index of a block with the top bit set.
#[derive(Clone, Copy)]
pub(super) struct Linked<'a> {
    pub(super) nodes: &'a [Node],
    pub(super) links: &'a [Link],
}

impl<'a> Linked<'a> {
    /// The node or block that `code` refers to, by its index.
    #[inline(always)]
    pub(super) fn decode(code: u32) -> NodeRef<usize> {
        if code & BLOCK != 0 {
            NodeRef::Block((code & !BLOCK) as usize)
        } else {
            NodeRef::Node(code as usize)
        }
    }
}

impl<'a> Topology<'a> for Linked<'a> {
    type Children = Link;

    #[inline(always)]
    fn resolve(self, code: u32) -> NodeRef<&'a Node> {
        match Self::decode(code) {
            NodeRef::Block(block) => NodeRef::Block(block),
            NodeRef::Node(node) => NodeRef::Node(&self.nodes[node]),
        }
    }

    #[inline(always)]
    fn children(self, code: u32) -> Link {
        self.links[code as usize]
    }

    #[inline(always)]
    fn child(self, link: Link, slot: u32) -> u32 {
        let nodes = link.nodes >> INDEX_BITS;
        if slot < nodes {
            (link.nodes & INDEX_MASK) + slot
        } else {
            BLOCK | (link.first_block + (slot - nodes))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::wide::WideTree;
    use super::*;

    #[test]
    fn links_number_nodes_before_blocks() {
        let tree = WideTree {
            links: vec![Link::new(MAX_INDEX - 1, 1, 7), Link::new(0, 0, 3)],
            ..WideTree::default()
        };
        let view = tree.view();
        let linked = view.linked();
        let places = |code: u32| {
            [0, 1, 2].map(|slot| Linked::decode(linked.child(linked.children(code), slot)))
        };
        assert_eq!(places(0), [NodeRef::Node(MAX_INDEX - 1), NodeRef::Block(7), NodeRef::Block(8)]);
        assert_eq!(places(1), [NodeRef::Block(3), NodeRef::Block(4), NodeRef::Block(5)]);
    }
}
