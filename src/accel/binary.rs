//! Binary trees on their way to 8-wide ones: what the builders that choose their splits by cost
//! agree on.

use super::Aabb;

/// A binary tree over references to particles or blocks.
#[derive(Debug, Default)]
pub(super) struct BinaryTree {
    /// Root first; the two children of an inner node lie side by side, after their parent.
    pub(super) nodes: Vec<BinaryNode>,
    /// What the leaves hold, by runs.
    pub(super) references: Vec<u32>,
}

/// A node of a [`BinaryTree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BinaryNode {
    /// Box of everything in it, in the space of the wide tree's boxes (see `WideTree::padding`).
    pub(super) bounds: Aabb,
    /// Inner nodes: the left child; the right one follows. Leaves: the first reference.
    pub(super) first: u32,
    /// References of a leaf; 0 for an inner node.
    pub(super) count: u32,
}

impl BinaryNode {
    /// Whether it has references instead of children.
    pub(super) fn is_leaf(&self) -> bool {
        self.count > 0
    }
}
