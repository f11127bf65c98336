//! From a binary tree over blocks to an 8-wide one.
//!
//! The children of a wide node are found by opening the largest of them until there are eight
//! (Wald, Benthin & Boulos 2008). Where a subtree would grow deeper than the walk allows, its
//! blocks, which lie in depth-first order, are dealt out evenly instead.

use rayon::prelude::*;

use super::levels::MAX_LEVELS;
use super::topology::Link;
use super::trim::TrimmedTree;
use spherule_formats::blocks::WIDTH;
use spherule_formats::order::index_u32;

/// The shape of a wide tree: level by level, the children of a node together.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// Where the children of each node are.
    pub(super) links: Vec<Link>,
    /// Children of each node.
    pub(super) child_counts: Vec<u8>,
    /// First node of each level.
    pub(super) level_starts: Vec<u32>,
    /// For each place, the block of the trimmed tree that comes there.
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

/// What becomes one child of a wide node.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// A node of the trimmed tree and what is below.
    Subtree(u32),
    /// Blocks without any order but that in which they lie.
    Run { first: u32, count: u32 },
}

/// The children of a wide node.
#[derive(Debug, Clone, Copy)]
struct Children {
    parts: [Part; WIDTH],
    count: u8,
}

/// Finds the shape of the wide tree. `last_block` is the one that may only come last of all, if
/// there is one.
pub(super) fn widen(tree: &TrimmedTree, last_block: Option<u32>) -> Layout {
    let mut layout = Layout::default();
    let mut level = Vec::new();
    level.extend((!tree.nodes.is_empty()).then_some(Part::Subtree(0)));
    let mut parent_of_last = None;
    while !level.is_empty() {
        let levels_below = MAX_LEVELS - 1 - layout.level_starts.len();
        layout.level_starts.push(index_u32(layout.links.len()));
        let families: Vec<Children> = level
            .par_iter()
            .with_min_len(64)
            .map(|part| Children::of(tree, *part, levels_below))
            .collect();
        let first_below = layout.links.len() + level.len();
        level.clear();
        for children in &families {
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
    if let Some((index, first_node, node_count, children)) = parent_of_last {
        layout.links[index] = Link::new(first_node, node_count, layout.blocks.len());
        let others = children.blocks(tree).filter(|b| Some(*b) != last_block);
        layout.blocks.extend(others.chain(last_block));
    }
    layout
}

impl Part {
    /// Blocks in it.
    fn count(self, tree: &TrimmedTree) -> u32 {
        match self {
            Self::Subtree(node) => tree.nodes[node as usize].count,
            Self::Run { count, .. } => count,
        }
    }

    /// The first block in it.
    fn first(self, tree: &TrimmedTree) -> u32 {
        match self {
            Self::Subtree(node) => tree.nodes[node as usize].first,
            Self::Run { first, .. } => first,
        }
    }

    fn is_block(self, tree: &TrimmedTree) -> bool {
        self.count(tree) == 1
    }

    /// The left child and the area of a part that can be opened.
    fn openable(self, tree: &TrimmedTree) -> Option<(u32, f32)> {
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
    /// The children of the node that `part` becomes, each of which can do with `levels` more.
    fn of(tree: &TrimmedTree, part: Part, levels: usize) -> Self {
        let most = (WIDTH as u64).saturating_pow(index_u32(levels));
        if let Some((left, _)) = part.openable(tree) {
            let opened = Self::opened(tree, left);
            let fits = |part: &Part| u64::from(part.count(tree)) <= most;
            if opened.all().iter().all(fits) {
                return opened;
            }
        }
        Self::dealt(part.first(tree), part.count(tree))
    }

    /// Opens the largest part until there are eight or none is left to be opened.
    fn opened(tree: &TrimmedTree, left: u32) -> Self {
        let mut children = Self {
            parts: [Part::Subtree(left); WIDTH],
            count: 2,
        };
        children.parts[1] = Part::Subtree(left + 1);
        while usize::from(children.count) < WIDTH {
            let candidates = children.all().iter().enumerate();
            let largest = candidates
                .filter_map(|(slot, part)| {
                    part.openable(tree).map(|(left, area)| (slot, left, area))
                })
                .reduce(|best, other| if other.2 > best.2 { other } else { best });
            let Some((slot, left, _)) = largest else {
                break;
            };
            // Neighbours stay neighbours.
            let count = usize::from(children.count);
            children.parts.copy_within(slot..count, slot + 1);
            children.parts[slot] = Part::Subtree(left);
            children.parts[slot + 1] = Part::Subtree(left + 1);
            children.count += 1;
        }
        children
    }

    /// Deals `count` blocks out evenly, in their order.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "eight parts at most, and no more blocks than count"
    )]
    fn dealt(first: u32, count: u32) -> Self {
        let parts = count.min(WIDTH as u32);
        let bound = |part: u32| {
            let blocks = u64::from(count) * u64::from(part) / u64::from(parts);
            first + blocks as u32
        };
        let mut children = Self {
            parts: [Part::Run { first, count }; WIDTH],
            count: parts as u8,
        };
        for part in 0..parts {
            children.parts[part as usize] = Part::Run {
                first: bound(part),
                count: bound(part + 1) - bound(part),
            };
        }
        children
    }

    fn all(&self) -> &[Part] {
        &self.parts[..usize::from(self.count)]
    }

    /// Those that are nodes.
    fn nodes(&self, tree: &TrimmedTree) -> impl Iterator<Item = Part> {
        self.all()
            .iter()
            .copied()
            .filter(|part| !part.is_block(tree))
    }

    /// Those that are blocks.
    fn blocks(&self, tree: &TrimmedTree) -> impl Iterator<Item = u32> {
        let blocks = self.all().iter().filter(|part| part.is_block(tree));
        blocks.map(|part| part.first(tree))
    }
}
