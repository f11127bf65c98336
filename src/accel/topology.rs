//! Where the children of a node are: by arithmetic in trees of whole levels, by links in trees of
//! any shape.
//!
//! A walk holds places as 32-bit codes that only the topology understands, so that the traversal
//! is one whatever the tree.

use bytemuck::{Pod, Zeroable};

use spherule_formats::blocks::{Node, WIDTH};

/// What a code stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place<N> {
    /// A node.
    Node(N),
    /// A block, by its number.
    Block(usize),
}

/// The shape of a tree.
pub(super) trait Topology<'a>: Copy {
    /// What is known of a node's children before one is chosen.
    type Children: Copy;

    /// Code of the root.
    const ROOT: u32 = 0;

    /// What `code` stands for.
    fn place(self, code: u32) -> Place<&'a Node>;

    /// The children of the node with `code`.
    fn children(self, code: u32) -> Self::Children;

    /// Code of the child in `slot`, under eight.
    fn child(self, children: Self::Children, slot: u32) -> u32;
}

/// Levels that a code of an implicit tree can tell apart.
pub(super) const LEVEL_CODES: usize = 16;

/// Bits of an implicit code below the level, and of a node's number in a link.
const INDEX_BITS: u32 = 28;
const INDEX_MASK: u32 = (1 << INDEX_BITS) - 1;
/// Most nodes or blocks that a code can tell apart.
pub(super) const MAX_INDEX: usize = 1 << INDEX_BITS;
const _: () = assert!(LEVEL_CODES == 1 << (u32::BITS - INDEX_BITS));

/// Whole levels: child `c` of node `i` is node `8 i + c` one level down, but on the one level that is
/// mapped. A code is the level in the upper bits, the number in the level under it.
#[derive(Clone, Copy)]
pub(super) struct Implicit<'a> {
    pub(super) levels: &'a [&'a [Node]; LEVEL_CODES],
    pub(super) depth: u32,
    pub(super) mapped_level: u32,
    pub(super) mapped: &'a [u32],
}

impl<'a> Implicit<'a> {
    /// Number of the first child of node `index` on `level`, among the nodes (or blocks) below.
    #[inline(always)]
    pub(super) fn first_child(self, level: u32, index: usize) -> usize {
        if level == self.mapped_level {
            self.mapped[index] as usize * WIDTH
        } else {
            index * WIDTH
        }
    }
}

impl<'a> Topology<'a> for Implicit<'a> {
    /// Code of the first child.
    type Children = u32;

    #[inline(always)]
    fn place(self, code: u32) -> Place<&'a Node> {
        let (level, index) = (code >> INDEX_BITS, (code & INDEX_MASK) as usize);
        if level == self.depth {
            Place::Block(index)
        } else {
            Place::Node(&self.levels[level as usize][index])
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

/// Where the children of one node are. They lie together, nodes first and then blocks, in slot
/// order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Link {
    /// Children that are nodes in the upper four bits, place of the first of them below.
    nodes: u32,
    /// Place of the first child that is a block.
    first_block: u32,
}

impl Link {
    /// The first `node_count` slots are nodes from `first_node` on, the others blocks from
    /// `first_block` on.
    ///
    /// # Panics
    /// If there are more nodes or blocks than can be numbered.
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

    /// Children that are nodes.
    pub(super) fn node_count(self) -> usize {
        (self.nodes >> INDEX_BITS) as usize
    }

    /// Place of the first of them.
    pub(super) fn first_node(self) -> usize {
        (self.nodes & INDEX_MASK) as usize
    }

    /// Place of the first child that is a block.
    pub(super) fn first_block(self) -> usize {
        self.first_block as usize
    }
}

/// The bit that tells the code of a block from that of a node.
const BLOCK: u32 = 1 << 31;

/// Any shape: a link for each node. A code is the number of a node, or of a block with the top bit
/// set.
#[derive(Clone, Copy)]
pub(super) struct Linked<'a> {
    pub(super) nodes: &'a [Node],
    pub(super) links: &'a [Link],
}

impl<'a> Linked<'a> {
    /// What `code` stands for, a node by its number.
    #[inline(always)]
    pub(super) fn number(code: u32) -> Place<usize> {
        if code & BLOCK != 0 {
            Place::Block((code & !BLOCK) as usize)
        } else {
            Place::Node(code as usize)
        }
    }
}

impl<'a> Topology<'a> for Linked<'a> {
    type Children = Link;

    #[inline(always)]
    fn place(self, code: u32) -> Place<&'a Node> {
        match Self::number(code) {
            Place::Block(block) => Place::Block(block),
            Place::Node(node) => Place::Node(&self.nodes[node]),
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
            [0, 1, 2].map(|slot| Linked::number(linked.child(linked.children(code), slot)))
        };
        assert_eq!(
            places(0),
            [Place::Node(MAX_INDEX - 1), Place::Block(7), Place::Block(8)]
        );
        assert_eq!(
            places(1),
            [Place::Block(3), Place::Block(4), Place::Block(5)]
        );
    }
}
