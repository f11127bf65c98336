//! Collapses binary trees into 8-wide ones with links. All builders that choose their splits by cost end here.
//!
//! There are three steps: subtrees that fit into one block become a block (`pack_leaves.rs`), wide nodes replace
//! groups of binary nodes (`collapse_nodes.rs`), and blocks and nodes are written to their final positions
//! (`linked.rs`).

use super::binary::BinaryTree;
use super::collapse_nodes::collapse_nodes;
use super::linked::{block_boxes, build_nodes, gather_blocks, reorder_blocks};
use super::pack_leaves::{LeafPacking, PackedTree};
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{SphereRadius, Spheres};
use crate::blocks::BLOCK_SIZE;
use crate::order::index_u32;

/// What the references of a binary tree refer to.
#[derive(Debug, Clone, Copy)]
pub(super) enum Content<'a> {
    /// Particles of the frame. Boxes are recomputed from them.
    Particles(Spheres<'a>),
    /// Particles of the frame, possibly several times. The box of a leaf, which bounds spheres, defines the part of
    /// the sphere that the leaf holds.
    Clipped(Spheres<'a>),
    /// Blocks that the wide tree already holds, as arrays; all but the last are full. Boxes are recomputed from them.
    Blocks,
}

/// Result of a collapse.
#[derive(Debug, Clone, Copy)]
pub(super) struct Collapsed {
    /// See `BuildReport::sah_cost`.
    pub(super) sah_cost: f64,
    /// Peak memory in bytes next to the wide tree; includes the binary tree.
    pub(super) scratch_bytes: u64,
}

/// Collapses `binary` into `tree`. With [`Content::Blocks`], the blocks of `tree` are kept and reordered; otherwise
/// all of it is replaced, and the indices are kept (`has_copies`). Records the phases `collapse` and `nodes`.
pub(super) fn collapse(
    tree: &mut WideTree,
    binary: BinaryTree,
    content: &Content,
    clock: &mut PhaseClock,
) -> Collapsed {
    if let Content::Particles(spheres) | Content::Clipped(spheres) = content {
        let common = match spheres.radius {
            SphereRadius::Common(radius) => Some(radius),
            SphereRadius::Each(_) => None,
        };
        tree.reset(spheres.centers.len(), common, true);
    }
    if matches!(content, Content::Clipped(_)) {
        tree.padding = 0.0;
    }
    // Turn subtrees that fit into one block into leaves
    let packed = PackedTree::new(
        &binary,
        LeafPacking {
            capacity: match content {
                Content::Blocks => 1,
                _ => BLOCK_SIZE,
            },
            padding: tree.padding,
            keep_boxes: matches!(content, Content::Clipped(_)),
        },
    );
    let mut scratch_bytes = binary_bytes(&binary) + packed.bytes();
    drop(binary);
    // Choose the children of each wide node
    let partial_index = match content {
        Content::Blocks => partial_block(tree, &packed),
        _ => None,
    };
    let layout = collapse_nodes(&packed, partial_index);
    // Write the particles to their blocks
    match content {
        Content::Blocks => {
            let copy = size_of_val(&tree.blocks[..]) as u64;
            scratch_bytes = scratch_bytes.max(packed.bytes() + layout.bytes() + copy);
            reorder_blocks(tree, &packed, &layout);
        }
        Content::Particles(spheres) | Content::Clipped(spheres) => {
            tree.resize_with_copies(layout.blocks.len());
            gather_blocks(tree, spheres, &packed, &layout);
        }
    }
    clock.lap("collapse");
    // Compute boxes from the blocks up and encode the nodes
    let boxes = block_boxes(tree, &packed.boxes, &layout);
    scratch_bytes =
        scratch_bytes.max(packed.bytes() + layout.bytes() + size_of_val(&boxes[..]) as u64);
    drop(packed);
    let sah_cost = build_nodes(tree, layout, &boxes);
    clock.lap("nodes");
    Collapsed { sah_cost, scratch_bytes }
}

/// The block of the packed tree that is not full. Slots up to the number of particles hold particles, so this block
/// must come last.
fn partial_block(tree: &WideTree, packed: &PackedTree) -> Option<u32> {
    if tree.count.is_multiple_of(BLOCK_SIZE) {
        return None;
    }
    let last = index_u32(tree.blocks.len() - 1);
    // With `Content::Blocks`, each packed block has one member.
    let place = packed.members.iter().position(|block| *block == last);
    place.map(index_u32)
}

fn binary_bytes(binary: &BinaryTree) -> u64 {
    (size_of_val(&binary.nodes[..]) + size_of_val(&binary.references[..])) as u64
}
