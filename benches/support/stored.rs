//! A tree's leaves as a native frame stores them, by the simplest encoder that is right.

use rayon::prelude::*;
use spherule::accel::view::TreeView;
use spherule_formats::blocks::{
    BLOCK_SIZE, Block, CompactBlock, CompactBlocks, Node, Q10Block, Q16Block, StoredBlocks,
    StoredLeaves, StoredRadii, WIDTH,
};

/// How positions are stored.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Encoding {
    F32,
    Q16,
    Q10,
}

impl Encoding {
    pub(crate) const ALL: [Self; 3] = [Self::F32, Self::Q16, Self::Q10];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::Q16 => "q16",
            Self::Q10 => "q10",
        }
    }
}

/// Leaves in memory of their own; none is kept as it is.
pub(crate) struct OwnedLeaves {
    count: usize,
    nodes: Vec<Node>,
    blocks: OwnedBlocks,
}

enum OwnedBlocks {
    F32(Vec<Block>),
    Q16(Vec<Q16Block>),
    Q10(Vec<Q10Block>),
}

impl OwnedLeaves {
    /// The particles of `tree`, which has each once, in its order.
    pub(crate) fn of(tree: &TreeView, encoding: Encoding) -> Self {
        let count = tree.len();
        let blocks: Vec<Block> = (0..count.div_ceil(BLOCK_SIZE))
            .into_par_iter()
            .map(|index| block_of(tree, index))
            .collect();
        let nodes: Vec<Node> = blocks.par_chunks(WIDTH).map(node_over).collect();
        let blocks = match encoding {
            Encoding::Q16 => OwnedBlocks::Q16(coded(&blocks, &nodes)),
            Encoding::Q10 => OwnedBlocks::Q10(coded(&blocks, &nodes)),
            Encoding::F32 => OwnedBlocks::F32(blocks),
        };
        Self { count, nodes, blocks }
    }

    /// As files give them.
    pub(crate) fn leaves(&self) -> StoredLeaves<'_> {
        StoredLeaves {
            count: self.count as u64,
            nodes: &self.nodes,
            blocks: match &self.blocks {
                OwnedBlocks::F32(blocks) => StoredBlocks::F32(blocks),
                OwnedBlocks::Q16(blocks) => StoredBlocks::Q16(CompactBlocks { blocks, wide: &[] }),
                OwnedBlocks::Q10(blocks) => StoredBlocks::Q10(CompactBlocks { blocks, wide: &[] }),
            },
            radii: StoredRadii::None,
        }
    }
}

/// Block `index`, the lowest particle in front, so that it can be coded.
fn block_of(tree: &TreeView, index: usize) -> Block {
    let first = index * BLOCK_SIZE;
    let last = (first + BLOCK_SIZE).min(tree.len()) - 1;
    #[expect(clippy::cast_possible_truncation, reason = "slots have 32 bits")]
    let center = |slot: usize| tree.sphere(slot as u32).0;
    let mut slots: [usize; BLOCK_SIZE] = std::array::from_fn(|lane| (first + lane).min(last));
    let lowest = (first..=last).min_by(|a, b| center(*a).z.total_cmp(&center(*b).z));
    slots.swap(0, lowest.map_or(0, |slot| slot - first));
    let mut block: Block = bytemuck::Zeroable::zeroed();
    for (lane, slot) in slots.into_iter().enumerate() {
        block.set_center(lane, center(slot));
    }
    block
}

fn node_over(blocks: &[Block]) -> Node {
    let bounds: Vec<_> = blocks.iter().map(Block::bounds).collect();
    Node::enclosing(&bounds)
}

fn coded<B: CompactBlock + Send>(blocks: &[Block], nodes: &[Node]) -> Vec<B> {
    let all = blocks.par_iter().enumerate();
    all.map(|(index, block)| {
        let frame = nodes[index / WIDTH].child_frame(index % WIDTH);
        let steps = B::steps(&frame);
        let mut codes = [[0; BLOCK_SIZE]; 3];
        for (axis, values) in [&block.x, &block.y, &block.z].into_iter().enumerate() {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_precision_loss,
                reason = "clamped to codes, which have 16 bits"
            )]
            let code = |value: &f32| {
                let code = (value - frame.base[axis]) / steps[axis];
                code.round().clamp(0.0, B::LARGEST[axis] as f32) as u32
            };
            codes[axis] = values.each_ref().map(code);
        }
        B::from_codes(&codes)
    })
    .collect()
}
