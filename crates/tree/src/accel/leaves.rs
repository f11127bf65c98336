//! The leaves of a tree in the form that kernels use: a reference to a block, or a block decoded on the fly.
//!
//! A decoded block should stay in registers, so everything here is inlined into the traversal.

use std::borrow::Borrow;

use glam::Vec3;

use super::simd::Kernel;
use crate::blocks::{
    Block, BlockFrame, BlockRadii, CompactBlock, CompactBlocks, Node, Q10Block, Q16Block,
    StoredRadii, WIDTH,
};

/// Access to the positions of a tree, by block.
pub(super) trait Leaves: Copy {
    /// A reference to a block, or a decoded block.
    type Loaded: Borrow<Block>;

    /// Block `index`.
    fn load<K: Kernel>(self, kernel: K, index: usize) -> Self::Loaded;

    /// Prefetches block `index`.
    fn prefetch<K: Kernel>(self, kernel: K, index: usize);
}

/// Blocks that are not coded.
#[derive(Clone, Copy)]
pub(super) struct Exact<'a>(pub(super) &'a [Block]);

impl<'a> Leaves for Exact<'a> {
    type Loaded = &'a Block;

    #[inline(always)]
    fn load<K: Kernel>(self, _kernel: K, index: usize) -> &'a Block {
        &self.0[index]
    }

    #[inline(always)]
    fn prefetch<K: Kernel>(self, kernel: K, index: usize) {
        kernel.prefetch(&self.0[index]);
    }
}

/// Coded blocks, on the grids of the nodes above them.
#[derive(Clone, Copy)]
pub(super) struct Coded<'a, B> {
    stored: CompactBlocks<'a, B>,
    nodes: &'a [Node],
}

impl<'a, B: CompactBlock> Coded<'a, B> {
    pub(super) fn new(stored: CompactBlocks<'a, B>, nodes: &'a [Node]) -> Self {
        Self { stored, nodes }
    }

    /// The uncoded copy of a block that could not be coded. None if the index is invalid, which happens only in
    /// damaged files.
    #[inline(always)]
    fn wide(self, block: &B) -> Option<&'a Block> {
        let index = block.wide_index()?;
        self.stored.wide.get(index as usize)
    }

    #[inline(always)]
    fn frame(self, index: usize) -> BlockFrame {
        self.nodes[index / WIDTH].child_frame(index % WIDTH)
    }

    /// The centre of one particle of block `index`, equal to that of [`Leaves::load`].
    pub(super) fn center(self, index: usize, lane: usize) -> Vec3 {
        let block = &self.stored.blocks[index];
        match self.wide(block) {
            Some(wide) => wide.center(lane),
            None => block.center(&self.frame(index), lane),
        }
    }
}

impl<B: DecodedBlock> Leaves for Coded<'_, B> {
    type Loaded = Block;

    #[inline(always)]
    fn load<K: Kernel>(self, kernel: K, index: usize) -> Block {
        let block = &self.stored.blocks[index];
        match self.wide(block) {
            Some(wide) => *wide,
            None => block.decode_with(kernel, &self.frame(index)),
        }
    }

    #[inline(always)]
    fn prefetch<K: Kernel>(self, kernel: K, index: usize) {
        kernel.prefetch(&self.stored.blocks[index]);
    }
}

/// A coded block with a decoder in each kernel.
pub(super) trait DecodedBlock: CompactBlock {
    /// [`CompactBlock::decode`] with the instructions of `kernel`; the same result to the bit.
    fn decode_with<K: Kernel>(&self, kernel: K, frame: &BlockFrame) -> Block;
}

impl DecodedBlock for Q10Block {
    #[inline(always)]
    fn decode_with<K: Kernel>(&self, kernel: K, frame: &BlockFrame) -> Block {
        kernel.decode_q10(self, frame)
    }
}

impl DecodedBlock for Q16Block {
    #[inline(always)]
    fn decode_with<K: Kernel>(&self, kernel: K, frame: &BlockFrame) -> Block {
        kernel.decode_q16(self, frame)
    }
}

/// The radii of a block.
pub(super) enum LoadedRadii<'a> {
    /// All spheres have the common radius.
    Common,
    /// A reference to stored radii.
    Stored(&'a BlockRadii),
    /// Radii decoded on the fly.
    Decoded(BlockRadii),
}

impl<'a> LoadedRadii<'a> {
    /// The radii of block `index`.
    #[inline(always)]
    pub(super) fn of(radii: &StoredRadii<'a>, index: usize) -> Self {
        match radii {
            StoredRadii::None => Self::Common,
            StoredRadii::F32(radii) => Self::Stored(&radii[index]),
            coded => coded.load(index).map_or(Self::Common, Self::Decoded),
        }
    }

    /// The radii as kernels expect them; None for the common radius.
    #[inline(always)]
    pub(super) fn as_ref(&self) -> Option<&BlockRadii> {
        match self {
            Self::Common => None,
            Self::Stored(radii) => Some(radii),
            Self::Decoded(radii) => Some(radii),
        }
    }
}
