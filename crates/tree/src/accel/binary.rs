//! Binary trees, the intermediate result of all builders that choose their splits by cost. They are collapsed into
//! 8-wide trees.

use super::Aabb;

/// A binary tree over references to particles or blocks.
#[derive(Debug, Default)]
pub(super) struct BinaryTree {
    /// Root first; the two children of an inner node lie side by side, after their parent.
    pub(super) nodes: Vec<BinaryNode>,
    /// References of the leaves; the references of one leaf are consecutive.
    pub(super) references: Vec<u32>,
}

/// A node of a [`BinaryTree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BinaryNode {
    /// Bounding box of the subtree, padded as the boxes of the wide tree are (see `WideTree::padding`).
    pub(super) bounds: Aabb,
    /// Index of the left child of an inner node (the right child follows it), or of the first reference of a leaf.
    pub(super) first: u32,
    /// Reference count of a leaf; 0 for an inner node.
    pub(super) count: u32,
}

impl BinaryNode {
    /// Whether the node has references instead of children.
    pub(super) fn is_leaf(&self) -> bool {
        self.count > 0
    }
}
