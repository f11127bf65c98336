//! Collapses a binary tree over blocks to an 8-wide one.
//!
//! To find the children of a wide node, the largest of them is replaced by its own children until there are eight
//! (Wald, Benthin & Boulos 2008). If a subtree would be deeper than the traversal allows, its blocks, which are in
//! depth-first order, are distributed evenly instead.

use rayon::prelude::*;

use super::levels::MAX_LEVELS;
use super::pack_leaves::PackedTree;
use super::topology::Link;
use crate::blocks::WIDTH;
use crate::order::index_u32;

/// The topology of a wide tree: level by level, the children of a node contiguous.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// Positions of the children of each node.
    pub(super) links: Vec<Link>,
    /// Number of children of each node.
    pub(super) child_counts: Vec<u8>,
    /// Index of the first node of each level.
    pub(super) level_starts: Vec<u32>,
    /// The block of the packed tree at each position of the result.
    pub(super) blocks: Vec<u32>,
}

impl Layout {
    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.links[..])
            + size_of_val(&self.child_counts[..])
            + size_of_val(&self.level_starts[..])
            + size_of_val(&self.blocks[..])) as u64
    }
}

/// A child of a wide node.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// A subtree of the packed tree, by the index of its root.
    Subtree(u32),
    /// A range of blocks.
    Run { first: u32, count: u32 },
}

/// The children of a wide node.
#[derive(Debug, Clone, Copy)]
struct Children {
    parts: [Part; WIDTH],
    count: u8,
}

/// Finds the topology of the wide tree. If there is a `last_block`, it gets the last position.
pub(super) fn collapse_nodes(tree: &PackedTree, last_block: Option<u32>) -> Layout {
    let mut layout = Layout::default();
    let mut level = Vec::new();
    level.extend((!tree.nodes.is_empty()).then_some(Part::Subtree(0)));
    let mut parent_of_last = None;
    while !level.is_empty() {
        // Choose the children of all nodes of the level
        let levels_below = MAX_LEVELS - 1 - layout.level_starts.len();
        layout.level_starts.push(index_u32(layout.links.len()));
        let children_of_nodes: Vec<Children> = level
            .par_iter()
            .with_min_len(64)
            .map(|part| Children::of(tree, *part, levels_below))
            .collect();
        // Assign positions to the children, node by node
        let first_below = layout.links.len() + level.len();
        level.clear();
        for children in &children_of_nodes {
            let first_node = first_below + level.len();
            level.extend(children.nodes(tree));
            let node_count = first_below + level.len() - first_node;
            let index = layout.links.len();
            let link = |first_block| Link::new(first_node, node_count, first_block);
            layout.links.push(link(layout.blocks.len()));
            layout.child_counts.push(children.count);
            if children.blocks(tree).any(|block| Some(block) == last_block) {
                parent_of_last = Some((index, first_node, node_count, *children));
            } else {
                layout.blocks.extend(children.blocks(tree));
            }
        }
    }
    // Append the blocks of the node with the last block, so that this block comes last
    if let Some((index, first_node, node_count, children)) = parent_of_last {
        layout.links[index] = Link::new(first_node, node_count, layout.blocks.len());
        let others = children.blocks(tree).filter(|b| Some(*b) != last_block);
        layout.blocks.extend(others.chain(last_block));
    }
    layout
}

impl Part {
    /// Number of blocks.
    fn count(self, tree: &PackedTree) -> u32 {
        match self {
            Self::Subtree(node) => tree.nodes[node as usize].count,
            Self::Run { count, .. } => count,
        }
    }

    /// Index of the first block.
    fn first(self, tree: &PackedTree) -> u32 {
        match self {
            Self::Subtree(node) => tree.nodes[node as usize].first,
            Self::Run { first, .. } => first,
        }
    }

    fn is_block(self, tree: &PackedTree) -> bool {
        self.count(tree) == 1
    }

    /// The left child and the area, if the part can be opened.
    fn as_openable(self, tree: &PackedTree) -> Option<(u32, f32)> {
        match self {
            Self::Subtree(node) => {
                let node = &tree.nodes[node as usize];
                (node.child > 0).then_some((node.child, node.area))
            }
            Self::Run { .. } => None,
        }
    }
}

impl Children {
    /// The children of the node that replaces `part`; each of them may have up to `levels` levels.
    fn of(tree: &PackedTree, part: Part, levels: usize) -> Self {
        let max_blocks = (WIDTH as u64).saturating_pow(index_u32(levels));
        if let Some((left, _)) = part.as_openable(tree) {
            let opened = Self::open_largest(tree, left);
            let fits = |part: &Part| u64::from(part.count(tree)) <= max_blocks;
            if opened.all().iter().all(fits) {
                return opened;
            }
        }
        Self::distribute(part.first(tree), part.count(tree))
    }

    /// Opens the largest part until there are eight parts or none can be opened.
    fn open_largest(tree: &PackedTree, left: u32) -> Self {
        let mut children = Self { parts: [Part::Subtree(left); WIDTH], count: 2 };
        children.parts[1] = Part::Subtree(left + 1);
        while usize::from(children.count) < WIDTH {
            // Find the part of largest area that can be opened
            let candidates = children.all().iter().enumerate();
            let largest = candidates
                .filter_map(|(slot, part)| {
                    part.as_openable(tree).map(|(left, area)| (slot, left, area))
                })
                .reduce(|best, other| if other.2 > best.2 { other } else { best });
            let Some((slot, left, _)) = largest else {
                break;
            };
            // Replace it by its two children, in order
            let count = usize::from(children.count);
            children.parts.copy_within(slot..count, slot + 1);
            children.parts[slot] = Part::Subtree(left);
            children.parts[slot + 1] = Part::Subtree(left + 1);
            children.count += 1;
        }
        children
    }

    /// Distributes `count` blocks evenly, in their order.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "eight parts at most, and no more blocks than count"
    )]
    fn distribute(first: u32, count: u32) -> Self {
        let parts = count.min(WIDTH as u32);
        let bound = |part: u32| {
            let blocks = u64::from(count) * u64::from(part) / u64::from(parts);
            first + blocks as u32
        };
        let mut children = Self { parts: [Part::Run { first, count }; WIDTH], count: parts as u8 };
        for part in 0..parts {
            children.parts[part as usize] =
                Part::Run { first: bound(part), count: bound(part + 1) - bound(part) };
        }
        children
    }

    fn all(&self) -> &[Part] {
        &self.parts[..usize::from(self.count)]
    }

    /// The parts that are nodes.
    fn nodes(&self, tree: &PackedTree) -> impl Iterator<Item = Part> {
        self.all().iter().copied().filter(|part| !part.is_block(tree))
    }

    /// The parts that are blocks.
    fn blocks(&self, tree: &PackedTree) -> impl Iterator<Item = u32> {
        let blocks = self.all().iter().filter(|part| part.is_block(tree));
        blocks.map(|part| part.first(tree))
    }
}
