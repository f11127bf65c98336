//! From binary trees to 8-wide ones with links: where every builder ends that chooses its splits by
//! cost.
//!
//! Three steps: subtrees that fit a block become one (`trim.rs`), wide nodes take the place of
//! several binary ones (`widen.rs`), and blocks and nodes are written where they belong
//! (`linked.rs`).

use super::binary::BinaryTree;
use super::linked::{block_boxes, build_nodes, gather_blocks, permute_blocks};
use super::report::PhaseClock;
use super::trim::{Trim, TrimmedTree};
use super::wide::WideTree;
use super::widen::widen;
use super::{SphereRadius, Spheres};
use spherule_formats::blocks::BLOCK_SIZE;
use spherule_formats::order::index_u32;

/// What the references of a binary tree stand for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Content<'a> {
    /// Particles of the frame. Boxes are made anew from them.
    Particles(Spheres<'a>),
    /// Particles of the frame, each perhaps in several leaves: the leaves' boxes, which bound
    /// spheres, tell which part of them counts.
    Clipped(Spheres<'a>),
    /// Blocks that are in the wide tree already, as arrays, all but the last of them full. Boxes
    /// are made anew from them.
    Blocks,
}

/// What a collapse came to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Collapsed {
    /// See `BuildReport::sah_cost`.
    pub(super) sah_cost: f64,
    /// Most bytes held beside the tree, the binary one counted.
    pub(super) scratch_bytes: u64,
}

/// Makes `tree` of `binary`. With [`Content::Blocks`] its blocks must be there and only change
/// places; otherwise all of it is replaced, and the indices stay (`has_copies`). Laps the phases
/// `collapse` and `nodes`.
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
    let trimmed = TrimmedTree::new(
        &binary,
        Trim {
            capacity: match content {
                Content::Blocks => 1,
                _ => BLOCK_SIZE,
            },
            padding: tree.padding,
            keep_boxes: matches!(content, Content::Clipped(_)),
        },
    );
    let mut scratch_bytes = binary_bytes(&binary) + trimmed.bytes();
    drop(binary);
    let unfilled = match content {
        Content::Blocks => unfilled_block(tree, &trimmed),
        _ => None,
    };
    let layout = widen(&trimmed, unfilled);
    match content {
        Content::Blocks => {
            let copy = size_of_val(&tree.blocks[..]) as u64;
            scratch_bytes = scratch_bytes.max(trimmed.bytes() + layout.bytes() + copy);
            permute_blocks(tree, &trimmed, &layout);
        }
        Content::Particles(spheres) | Content::Clipped(spheres) => {
            tree.make_room_for_copies(layout.blocks.len());
            gather_blocks(tree, spheres, &trimmed, &layout);
        }
    }
    clock.lap("collapse");
    let boxes = block_boxes(tree, &trimmed.boxes, &layout);
    scratch_bytes =
        scratch_bytes.max(trimmed.bytes() + layout.bytes() + size_of_val(&boxes[..]) as u64);
    drop(trimmed);
    let sah_cost = build_nodes(tree, layout, &boxes);
    clock.lap("nodes");
    Collapsed {
        sah_cost,
        scratch_bytes,
    }
}

/// Which block of the trimmed tree is the one that is not full. Slots are counted through to the
/// number of particles, so that one must come last.
fn unfilled_block(tree: &WideTree, trimmed: &TrimmedTree) -> Option<u32> {
    if tree.count.is_multiple_of(BLOCK_SIZE) {
        return None;
    }
    let last = index_u32(tree.blocks.len() - 1);
    // Here blocks have one member each.
    let place = trimmed.members.iter().position(|block| *block == last);
    place.map(index_u32)
}

fn binary_bytes(binary: &BinaryTree) -> u64 {
    (size_of_val(&binary.nodes[..]) + size_of_val(&binary.references[..])) as u64
}
