//! The nodes of a moving tree: the topology of another tree, with boxes computed from the moving blocks.

use rayon::prelude::*;

use super::super::leaves::Leaves;
use super::super::simd::PacketKernel;
use super::super::topology::{NodeRef, Topology};
use super::super::view::{Resolved, TreeTask, TreeView};
use super::node::{BLOCK, MovingBlock, MovingBounds, MovingNode};
use crate::order::index_u32;

/// Levels below the root whose subtrees are computed in parallel.
const PARALLEL_LEVELS: u32 = 3;

/// The nodes over `blocks` with the topology of `tree`, root first; empty without blocks.
pub(super) fn nodes_over(tree: &TreeView<'_>, blocks: &[MovingBlock]) -> Vec<MovingNode> {
    match blocks {
        [] => Vec::new(),
        // A single block has no node in a static tree
        [block] => {
            let mut root = MovingNode::EMPTY;
            root.set(0, &block.bounds(), BLOCK);
            vec![root]
        }
        _ => tree.run(Refit { blocks }).nodes,
    }
}

/// Computes all nodes of a tree.
struct Refit<'b> {
    blocks: &'b [MovingBlock],
}

/// A subtree: its nodes, numbered from its own root on.
struct Subtree {
    /// Empty for a block.
    nodes: Vec<MovingNode>,
    bounds: MovingBounds,
    /// Code of its root.
    code: u32,
}

impl TreeTask for Refit<'_> {
    type Output = Subtree;

    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        _: K,
        tree: Resolved<'a, T, L>,
    ) -> Subtree {
        subtree(tree.topology, self.blocks, T::ROOT, 0)
    }
}

/// The subtree with `code`, `level` levels below the root.
fn subtree<'a, T: Topology<'a>>(
    topology: T,
    blocks: &[MovingBlock],
    code: u32,
    level: u32,
) -> Subtree {
    let node = match topology.resolve(code) {
        NodeRef::Block(block) => {
            return Subtree {
                nodes: Vec::new(),
                bounds: blocks[block].bounds(),
                code: BLOCK | index_u32(block),
            };
        }
        NodeRef::Node(node) => node,
    };
    // Compute the children
    let children = topology.children(code);
    let codes: Vec<u32> =
        (0..index_u32(node.child_count())).map(|slot| topology.child(children, slot)).collect();
    let below = |code: &u32| subtree(topology, blocks, *code, level + 1);
    let subtrees: Vec<Subtree> = if level < PARALLEL_LEVELS {
        codes.par_iter().map(below).collect()
    } else {
        codes.iter().map(below).collect()
    };
    // Append their nodes to the parent
    let mut nodes = vec![MovingNode::EMPTY];
    let mut bounds = MovingBounds::EMPTY;
    for (slot, child) in subtrees.into_iter().enumerate() {
        let first = index_u32(nodes.len());
        nodes.extend(child.nodes.into_iter().map(|node| node.moved_by(first)));
        let code = match child.code & BLOCK {
            0 => child.code + first,
            _ => child.code,
        };
        nodes[0].set(slot, &child.bounds, code);
        bounds = bounds.union(child.bounds);
    }
    Subtree { nodes, bounds, code: 0 }
}
