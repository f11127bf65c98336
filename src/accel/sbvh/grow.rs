//! The recursion: which rules a node is offered, and where the subtrees go.
//!
//! Large subtrees are joined by all threads; from [`SUBTREE`] references on, one thread fills one
//! binary tree. They are put one after the other at the end, depth first, so that the result does
//! not depend on who built what.

use super::super::binary::{BinaryNode, BinaryTree};
use super::cost;
use super::divide::{Roomed, by_number, by_split};
use super::object::BinnedObjectSplit;
use super::reference::{Bounds, Parts};
use super::spatial::SpatialSplit;
use super::split::{Set, Split, SplitRule};
use super::sweep::{SWEEP_LEN, SweptObjectSplit};
use spherule_formats::blocks::BLOCK_SIZE;
use spherule_formats::order::index_u32;

/// Below this a task of its own costs more than it saves.
const SUBTREE: usize = 4096;
/// Depth from which nodes are halved by number: twice what any frame of use needs, and the recursion
/// stays bounded.
const MAX_SAH_DEPTH: u32 = 64;

/// What does not change from node to node.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grower<'a> {
    parts: Parts<'a>,
    /// Overlap of an object split, as an area, above which a spatial one is looked for.
    tolerated_overlap: f64,
}

/// What became of a node: a tree, or two.
pub(super) enum Grown {
    Tree(BinaryTree),
    Split(Bounds, Box<[Grown; 2]>),
}

impl Grown {
    /// Its root, to be filled in.
    pub(super) fn root(&self) -> BinaryNode {
        match self {
            Self::Tree(tree) => tree.nodes[0],
            Self::Split(bounds, _) => inner(*bounds, 0),
        }
    }

    /// Nodes and references in all of it.
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

/// An inner node whose children lie at `first`.
pub(super) fn inner(bounds: Bounds, first: usize) -> BinaryNode {
    BinaryNode {
        bounds: bounds.to_aabb(),
        first: index_u32(first),
        count: 0,
    }
}

/// Makes the node in the place `at` a leaf.
fn leaf(tree: &mut BinaryTree, at: usize, node: &Roomed<'_>) {
    tree.nodes[at] = BinaryNode {
        bounds: node.bounds.to_aabb(),
        first: index_u32(tree.references.len()),
        count: index_u32(node.count),
    };
    let references = &node.room[..node.count];
    tree.references
        .extend(references.iter().map(|r| r.particle));
}

impl<'a> Grower<'a> {
    /// `alpha` as a part of the area of `root`.
    pub(super) fn new(parts: Parts<'a>, root: Bounds, alpha: f32) -> Self {
        Self {
            parts,
            tolerated_overlap: f64::from(alpha) * root.area(),
        }
    }

    pub(super) fn grow(&self, node: Roomed<'_>, depth: u32) -> Grown {
        let bounds = node.bounds;
        if node.count <= SUBTREE {
            let mut tree = BinaryTree::default();
            tree.nodes.push(inner(bounds, 0));
            self.grow_in(&mut tree, 0, node, depth);
            // All of them are held until the last is there.
            tree.nodes.shrink_to_fit();
            tree.references.shrink_to_fit();
            return Grown::Tree(tree);
        }
        let [below, above] = match self.choose(&node, depth) {
            Some(split) => by_split(node, &split, self.parts),
            None => by_number(node),
        };
        let (below, above) = rayon::join(
            || self.grow(below, depth + 1),
            || self.grow(above, depth + 1),
        );
        Grown::Split(bounds, Box::new([below, above]))
    }

    /// Grows `node` in the place `at` of `tree`.
    fn grow_in(&self, tree: &mut BinaryTree, at: usize, node: Roomed<'_>, depth: u32) {
        let bounds = node.bounds;
        let halves = match self.choose(&node, depth) {
            Some(split) => by_split(node, &split, self.parts),
            None if node.count <= BLOCK_SIZE => return leaf(tree, at, &node),
            None => by_number(node),
        };
        let first = tree.nodes.len();
        tree.nodes[at] = inner(bounds, first);
        for half in &halves {
            tree.nodes.push(inner(half.bounds, 0));
        }
        for (half, at) in halves.into_iter().zip(first..) {
            self.grow_in(tree, at, half, depth + 1);
        }
    }

    /// The cheapest split, None for a leaf or a set that no rule can split.
    fn choose(&self, node: &Roomed<'_>, depth: u32) -> Option<Split> {
        let references = &node.room[..node.count];
        if node.count < 2 || depth >= MAX_SAH_DEPTH {
            return None;
        }
        let set = Set {
            references,
            bounds: node.bounds,
            parts: self.parts,
            free: node.room.len() - node.count,
        };
        let object = if node.count <= SWEEP_LEN {
            SweptObjectSplit.find(&set)
        } else {
            BinnedObjectSplit.find(&set)
        };
        if node.count <= BLOCK_SIZE {
            // One block whatever is in it: only a much smaller pair of boxes is worth another.
            let area = node.bounds.area();
            let leaf = cost::of_set(area, node.count) - cost::INNER_NODE * area;
            return object.filter(|split| split.cost < leaf);
        }
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
