//! The recursion of the build: selects a split for each node and builds the subtrees.
//!
//! All threads share the upper nodes. A subtree of at most [`SUBTREE`] references is built by one thread as one
//! binary tree. These trees are concatenated at the end, depth first, so the result does not depend on the assignment
//! to threads.

use super::super::binary::{BinaryNode, BinaryTree};
use super::cost;
use super::divide::{BuildNode, by_number, by_split};
use super::object::BinnedObjectSplit;
use super::reference::{Bounds, Parts};
use super::spatial::SpatialSplit;
use super::split::{PrimSet, Split, SplitRule};
use super::sweep::{SWEEP_LEN, SweptObjectSplit};
use crate::blocks::BLOCK_SIZE;
use crate::order::index_u32;

/// Smaller subtrees are not worth a task of their own.
const SUBTREE: usize = 4096;
/// Depth from which nodes are split at the median, to bound the recursion: twice the depth that practical frames need.
const MAX_SAH_DEPTH: u32 = 64;

/// Parameters of the build that are the same for all nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grower<'a> {
    parts: Parts<'a>,
    /// If the children of an object split overlap by more than this area, a spatial split is searched as well.
    tolerated_overlap: f64,
}

/// A finished subtree: one tree, or a node over two subtrees.
pub(super) enum Grown {
    Tree(BinaryTree),
    Split(Bounds, Box<[Grown; 2]>),
}

impl Grown {
    /// Its root node, with child indices still to be set.
    pub(super) fn root(&self) -> BinaryNode {
        match self {
            Self::Tree(tree) => tree.nodes[0],
            Self::Split(bounds, _) => inner(*bounds, 0),
        }
    }

    /// Total count of nodes and references.
    pub(super) fn lengths(&self) -> (usize, usize) {
        match self {
            Self::Tree(tree) => (tree.nodes.len(), tree.references.len()),
            Self::Split(_, halves) => halves.iter().fold((1, 0), |(nodes, references), half| {
                let (more_nodes, more_references) = half.lengths();
                (nodes + more_nodes, references + more_references)
            }),
        }
    }
}

/// An inner node with children at index `first`.
pub(super) fn inner(bounds: Bounds, first: usize) -> BinaryNode {
    BinaryNode { bounds: bounds.to_aabb(), first: index_u32(first), count: 0 }
}

/// Turns the node at index `at` into a leaf.
fn leaf(tree: &mut BinaryTree, at: usize, node: &BuildNode<'_>) {
    tree.nodes[at] = BinaryNode {
        bounds: node.bounds.to_aabb(),
        first: index_u32(tree.references.len()),
        count: index_u32(node.count),
    };
    let references = &node.storage[..node.count];
    tree.references.extend(references.iter().map(|r| r.particle));
}

impl<'a> Grower<'a> {
    /// `alpha` is a fraction of the area of `root`.
    pub(super) fn new(parts: Parts<'a>, root: Bounds, alpha: f32) -> Self {
        Self { parts, tolerated_overlap: f64::from(alpha) * root.area() }
    }

    pub(super) fn grow(&self, node: BuildNode<'_>, depth: u32) -> Grown {
        let bounds = node.bounds;
        if node.count <= SUBTREE {
            // Build a small subtree on this thread
            let mut tree = BinaryTree::default();
            tree.nodes.push(inner(bounds, 0));
            self.grow_in(&mut tree, 0, node, depth);
            // All subtrees stay in memory until the last one is finished.
            tree.nodes.shrink_to_fit();
            tree.references.shrink_to_fit();
            return Grown::Tree(tree);
        }
        // Split a large node, and build its children in parallel
        let [below, above] = match self.choose(&node, depth) {
            Some(split) => by_split(node, &split, self.parts),
            None => by_number(node),
        };
        let (below, above) =
            rayon::join(|| self.grow(below, depth + 1), || self.grow(above, depth + 1));
        Grown::Split(bounds, Box::new([below, above]))
    }

    /// Builds `node` at index `at` of `tree`.
    fn grow_in(&self, tree: &mut BinaryTree, at: usize, node: BuildNode<'_>, depth: u32) {
        let bounds = node.bounds;
        let halves = match self.choose(&node, depth) {
            Some(split) => by_split(node, &split, self.parts),
            None if node.count <= BLOCK_SIZE => return leaf(tree, at, &node),
            None => by_number(node),
        };
        // Append the two children, then build each of them
        let first = tree.nodes.len();
        tree.nodes[at] = inner(bounds, first);
        for half in &halves {
            tree.nodes.push(inner(half.bounds, 0));
        }
        for (half, at) in halves.into_iter().zip(first..) {
            self.grow_in(tree, at, half, depth + 1);
        }
    }

    /// The cheapest split; None for a leaf or for a set that no rule can split.
    fn choose(&self, node: &BuildNode<'_>, depth: u32) -> Option<Split> {
        let references = &node.storage[..node.count];
        if node.count < 2 || depth >= MAX_SAH_DEPTH {
            return None;
        }
        let set = PrimSet {
            references,
            bounds: node.bounds,
            parts: self.parts,
            free: node.storage.len() - node.count,
        };
        // Find the best object split, exactly in small nodes
        let object = if node.count <= SWEEP_LEN {
            SweptObjectSplit.find(&set)
        } else {
            BinnedObjectSplit.find(&set)
        };
        if node.count <= BLOCK_SIZE {
            // A set that fits into one block is split only if the boxes become much smaller.
            let area = node.bounds.area();
            let leaf = cost::of_set(area, node.count) - cost::INNER_NODE * area;
            return object.filter(|split| split.cost < leaf);
        }
        // Search for a spatial split if the children of the object split overlap
        let overlap = object.map_or(f64::INFINITY, |split| {
            let [below, above] = split.boxes;
            below.intersection(above).area()
        });
        if set.free == 0 || overlap <= self.tolerated_overlap {
            return object;
        }
        match (object, SpatialSplit.find(&set)) {
            (Some(object), Some(spatial)) if object.cost <= spatial.cost => Some(object),
            (object, spatial) => spatial.or(object),
        }
    }
}
