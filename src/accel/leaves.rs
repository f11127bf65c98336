//! The leaves of a tree as kernels take them: a block where it lies, or decoded on the way.
//!
//! A decoded block is meant to stay in registers: everything here is inlined into the walk.

use std::borrow::Borrow;

use glam::Vec3;

use super::simd::Kernel;
use spherule_formats::blocks::{
    Block, BlockFrame, BlockRadii, CompactBlock, CompactBlocks, Node, Q10Block, Q16Block,
    StoredRadii, WIDTH,
};

/// Positions by block.
pub(super) trait Leaves: Copy {
    /// A block, there or decoded.
    type Loaded: Borrow<Block>;

    /// Block `index`.
    fn load<K: Kernel>(self, kernel: K, index: usize) -> Self::Loaded;

    /// Asks for the memory of block `index` ahead of time.
    fn prefetch<K: Kernel>(self, kernel: K, index: usize);
}

/// Blocks as they are.
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

/// Coded blocks on the grids of the nodes above them.
#[derive(Clone, Copy)]
pub(super) struct Coded<'a, B> {
    stored: CompactBlocks<'a, B>,
    nodes: &'a [Node],
}

impl<'a, B: CompactBlock> Coded<'a, B> {
    pub(super) fn new(stored: CompactBlocks<'a, B>, nodes: &'a [Node]) -> Self {
        Self { stored, nodes }
    }

    /// The block as it is, where it could not be coded. None for one that is not there, which only a
    /// damaged file refers to.
    #[inline(always)]
    fn wide(self, block: &B) -> Option<&'a Block> {
        let index = block.wide_index()?;
        self.stored.wide.get(index as usize)
    }

    #[inline(always)]
    fn frame(self, index: usize) -> BlockFrame {
        self.nodes[index / WIDTH].child_frame(index % WIDTH)
    }

    /// One particle of block `index`, as [`Leaves::load`] has it.
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

/// A coded block that kernels decode.
pub(super) trait DecodedBlock: CompactBlock {
    /// [`CompactBlock::decode`] by `kernel`, the same to the bit.
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

/// Radii of a block.
pub(super) enum LoadedRadii<'a> {
    /// The common radius is meant.
    Common,
    /// Where they lie.
    There(&'a BlockRadii),
    /// Decoded.
    Decoded(BlockRadii),
}

impl<'a> LoadedRadii<'a> {
    /// Those of block `index`.
    #[inline(always)]
    pub(super) fn of(radii: &StoredRadii<'a>, index: usize) -> Self {
        match radii {
            StoredRadii::None => Self::Common,
            StoredRadii::F32(radii) => Self::There(&radii[index]),
            coded => coded.load(index).map_or(Self::Common, Self::Decoded),
        }
    }

    /// As kernels take them.
    #[inline(always)]
    pub(super) fn as_ref(&self) -> Option<&BlockRadii> {
        match self {
            Self::Common => None,
            Self::There(radii) => Some(radii),
            Self::Decoded(radii) => Some(radii),
        }
    }
}
