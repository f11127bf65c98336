//! From a binary tree to one whose leaves are whole blocks.
//!
//! A block costs the same to test whether it is full or not, so a subtree that fits one block
//! becomes one wherever the surface area heuristic says so. What then is left lies in depth-first
//! order: every subtree is a run of blocks.

use super::Aabb;
use super::binary::{BinaryNode, BinaryTree};
use spherule_formats::order::index_u32;

/// A binary tree over blocks.
#[derive(Debug, Default)]
pub(super) struct TrimmedTree {
    /// Root first, children after their parents; empty without blocks.
    pub(super) nodes: Vec<TrimmedNode>,
    /// First member of each block, and the member count at the end.
    pub(super) starts: Vec<u32>,
    /// The references of the blocks.
    pub(super) members: Vec<u32>,
    /// Box that each block's references were given; empty if not asked for.
    pub(super) boxes: Vec<Aabb>,
}

/// A node of a [`TrimmedTree`].
#[derive(Debug, Clone, Copy)]
pub(super) struct TrimmedNode {
    /// Surface area as a fraction of the root's: the chance of a ray that meets the root.
    pub(super) area: f32,
    /// The left child, which the right one follows; 0 for leaves.
    pub(super) child: u32,
    /// First block below.
    pub(super) first: u32,
    /// Blocks below; more than one in a leaf that had more references than one block takes.
    pub(super) count: u32,
}

/// How references become blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trim {
    /// References that one block takes.
    pub(super) capacity: usize,
    /// Length to add to the boxes for their true area (see `WideTree::padding`).
    pub(super) padding: f32,
    /// Whether to note the boxes that references were given.
    pub(super) keep_boxes: bool,
}

/// What a subtree costs.
#[derive(Debug, Clone, Copy, Default)]
struct Cost {
    /// Expected tests of a ray that meets the root, at best.
    tests: f32,
    /// References in it; saturates.
    references: u16,
    /// Whether it is best as one block.
    is_block: bool,
}

/// What keeping two subtrees apart costs, in tests of their parent's box: their places in a node
/// and their memory. At 1/7, the bare share in a node, blocks are as fast and 6 % larger (clustered
/// particles of the thesis's box, 1e6).
const SPLIT_COST: f32 = 0.5;

impl TrimmedTree {
    /// Turns `binary` into a tree of blocks.
    pub(super) fn new(binary: &BinaryTree, trim: Trim) -> Self {
        let mut trimmed = Self::default();
        if binary.nodes.is_empty() {
            return trimmed;
        }
        let costs = costs(binary, trim);
        let areas = Areas::of(binary, trim.padding);
        trimmed.members.reserve_exact(binary.references.len());
        // Each at most; a growing vector would hold up to three times what it needs.
        trimmed.nodes.reserve_exact(binary.nodes.len());
        trimmed.starts.reserve_exact(binary.references.len() + 1);
        trimmed.nodes.push(trimmed.leaf());
        let mut pending = vec![(0_u32, 0_u32)];
        while let Some((index, place)) = pending.pop() {
            let node = &binary.nodes[index as usize];
            let mut own = trimmed.leaf();
            own.area = areas.fraction(node);
            if node.is_leaf() || costs[index as usize].is_block {
                trimmed.add_blocks(binary, index, trim);
            } else {
                own.child = index_u32(trimmed.nodes.len());
                trimmed.nodes.extend([own; 2]);
                // The left one is taken next, so that blocks lie in depth-first order.
                pending.push((node.first + 1, own.child + 1));
                pending.push((node.first, own.child));
            }
            own.count = trimmed.block_count() - own.first;
            trimmed.nodes[place as usize] = own;
        }
        trimmed.starts.push(index_u32(trimmed.members.len()));
        trimmed.count_blocks();
        trimmed.nodes.shrink_to_fit();
        trimmed.starts.shrink_to_fit();
        trimmed
    }

    /// The references of `block`.
    pub(super) fn members(&self, block: u32) -> &[u32] {
        let block = block as usize;
        &self.members[self.starts[block] as usize..self.starts[block + 1] as usize]
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.nodes[..])
            + size_of_val(&self.starts[..])
            + size_of_val(&self.members[..])
            + size_of_val(&self.boxes[..])) as u64
    }

    fn block_count(&self) -> u32 {
        index_u32(self.starts.len())
    }

    fn leaf(&self) -> TrimmedNode {
        TrimmedNode {
            area: 0.0,
            child: 0,
            first: self.block_count(),
            count: 0,
        }
    }

    /// Makes one block of the subtree of node `index`, or several of a leaf too large for one.
    fn add_blocks(&mut self, binary: &BinaryTree, index: u32, trim: Trim) {
        let node = &binary.nodes[index as usize];
        if node.is_leaf() {
            for block in references(binary, node).chunks(trim.capacity) {
                self.begin_block(node, trim);
                self.members.extend_from_slice(block);
            }
            return;
        }
        self.begin_block(node, trim);
        let begin = self.members.len();
        let mut pending = vec![index];
        while let Some(index) = pending.pop() {
            let node = &binary.nodes[index as usize];
            if node.is_leaf() {
                self.members.extend_from_slice(references(binary, node));
            } else {
                pending.extend([node.first + 1, node.first]);
            }
        }
        drop_repeated(&mut self.members, begin);
    }

    fn begin_block(&mut self, node: &BinaryNode, trim: Trim) {
        self.starts.push(index_u32(self.members.len()));
        if trim.keep_boxes {
            self.boxes.push(node.bounds);
        }
    }

    fn count_blocks(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            let child = self.nodes[index].child as usize;
            if child > 0 {
                self.nodes[index].count = self.nodes[child].count + self.nodes[child + 1].count;
            }
        }
    }
}

/// What a leaf holds.
fn references<'a>(binary: &'a BinaryTree, leaf: &BinaryNode) -> &'a [u32] {
    &binary.references[leaf.first as usize..][..leaf.count as usize]
}

/// Leaves of one subtree may share particles that a spatial split has cut; one block needs them
/// once.
fn drop_repeated(members: &mut Vec<u32>, begin: usize) {
    members[begin..].sort_unstable();
    let mut kept = begin;
    for from in begin..members.len() {
        if kept == begin || members[kept - 1] != members[from] {
            members[kept] = members[from];
            kept += 1;
        }
    }
    members.truncate(kept);
}

/// Decides from the leaves up which subtrees are one block, as an optimal cut of a tree into leaves
/// is found (Goldsmith & Salmon 1987 gave the costs).
fn costs(binary: &BinaryTree, trim: Trim) -> Vec<Cost> {
    let areas = Areas::of(binary, trim.padding);
    let mut costs = vec![Cost::default(); binary.nodes.len()];
    for (index, node) in binary.nodes.iter().enumerate().rev() {
        let area = areas.fraction(node);
        let (references, apart) = if node.is_leaf() {
            let blocks = (node.count as usize).div_ceil(trim.capacity);
            let references = u16::try_from(node.count).unwrap_or(u16::MAX);
            (references, area * blocks as f32)
        } else {
            let [a, b] = [0, 1].map(|side| costs[node.first as usize + side]);
            let references = a.references.saturating_add(b.references);
            (references, a.tests + b.tests + area * SPLIT_COST)
        };
        let is_block = usize::from(references) <= trim.capacity && area <= apart;
        costs[index] = Cost {
            tests: if is_block { area } else { apart },
            references,
            is_block,
        };
    }
    costs
}

/// Surface areas as fractions of the root's.
#[derive(Debug, Clone, Copy)]
struct Areas {
    padding: f32,
    root: f64,
}

impl Areas {
    fn of(binary: &BinaryTree, padding: f32) -> Self {
        let root = binary
            .nodes
            .first()
            .map_or(0.0, |root| root.bounds.padded(padding).area());
        Self { padding, root }
    }

    #[expect(clippy::cast_possible_truncation, reason = "only compared")]
    fn fraction(&self, node: &BinaryNode) -> f32 {
        if self.root > 0.0 {
            (node.bounds.padded(self.padding).area() / self.root) as f32
        } else {
            0.0
        }
    }
}
