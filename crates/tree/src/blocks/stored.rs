//! The leaves of a tree in a native frame: plain arrays in a mapped file.

use glam::Vec3;

use super::{
    BLOCK_SIZE, Block, BlockFrame, BlockRadii, CompactBlock, Node, Q10Block, Q16Block, WIDTH,
};

/// The leaves, in place. The lengths match each other (blocks for `count` particles, nodes for these blocks).
/// The contents come from a file and may be anything.
#[derive(Debug, Clone, Copy)]
pub struct StoredLeaves<'a> {
    /// Number of particles.
    pub count: u64,
    /// One node for each eight blocks: boxes of the centres, or of the spheres if radii differ.
    pub nodes: &'a [Node],
    /// Positions, [`BLOCK_SIZE`] per block.
    pub blocks: StoredBlocks<'a>,
    /// Radii.
    pub radii: StoredRadii<'a>,
}

/// The positions in one of the encodings.
#[derive(Debug, Clone, Copy)]
pub enum StoredBlocks<'a> {
    /// Unchanged f32.
    F32(&'a [Block]),
    /// 16 bits per axis.
    Q16(CompactBlocks<'a, Q16Block>),
    /// 11, 11 and 10 bits.
    Q10(CompactBlocks<'a, Q10Block>),
}

/// Coded blocks, and the blocks that could not be coded.
#[derive(Debug, Clone, Copy)]
pub struct CompactBlocks<'a, B> {
    /// All blocks: coded ones and references.
    pub blocks: &'a [B],
    /// The blocks that references point to.
    pub wide: &'a [Block],
}

/// The radii in one of the encodings; coded radii are `low + code * step`.
#[derive(Debug, Clone, Copy)]
pub enum StoredRadii<'a> {
    /// All radii are equal or unknown; none are stored here.
    None,
    /// Unchanged f32.
    F32(&'a [BlockRadii]),
    /// 16 bits.
    U16 {
        /// Codes, block by block.
        codes: &'a [[u16; BLOCK_SIZE]],
        /// Radius of code 0.
        low: f32,
        /// Difference of the radii of successive codes.
        step: f32,
    },
    /// 8 bits.
    U8 {
        /// Codes, block by block.
        codes: &'a [[u8; BLOCK_SIZE]],
        /// Radius of code 0.
        low: f32,
        /// Difference of the radii of successive codes.
        step: f32,
    },
}

impl<B: CompactBlock> CompactBlocks<'_, B> {
    /// The positions of block `index`; `frame` is its grid. A reference to a missing block, which only a
    /// damaged file contains, is decoded as if it were a coded block.
    ///
    /// # Panics
    /// If block `index` does not exist.
    #[inline(always)]
    pub fn load(&self, index: usize, frame: &BlockFrame) -> Block {
        let block = &self.blocks[index];
        match block.wide_index().and_then(|i| self.wide.get(i as usize)) {
            Some(wide) => *wide,
            None => block.decode(frame),
        }
    }
}

impl StoredRadii<'_> {
    /// The radii of block `index`; `None` if no radii are stored.
    ///
    /// # Panics
    /// If block `index` does not exist.
    #[inline(always)]
    pub fn load(&self, index: usize) -> Option<BlockRadii> {
        Some(match self {
            Self::None => return None,
            Self::F32(radii) => radii[index],
            Self::U16 { codes, low, step } => {
                BlockRadii(codes[index].map(|code| low + f32::from(code) * step))
            }
            Self::U8 { codes, low, step } => {
                BlockRadii(codes[index].map(|code| low + f32::from(code) * step))
            }
        })
    }
}

impl StoredLeaves<'_> {
    /// The positions of block `index`.
    ///
    /// # Panics
    /// If block `index` does not exist.
    pub fn block(&self, index: usize) -> Block {
        let frame = self.nodes[index / WIDTH].child_frame(index % WIDTH);
        match &self.blocks {
            StoredBlocks::F32(blocks) => blocks[index],
            StoredBlocks::Q16(compact) => compact.load(index, &frame),
            StoredBlocks::Q10(compact) => compact.load(index, &frame),
        }
    }

    /// Number of blocks.
    pub fn block_count(&self) -> usize {
        match &self.blocks {
            StoredBlocks::F32(blocks) => blocks.len(),
            StoredBlocks::Q16(compact) => compact.blocks.len(),
            StoredBlocks::Q10(compact) => compact.blocks.len(),
        }
    }

    /// The position of particle `index`.
    ///
    /// # Panics
    /// If particle `index` does not exist.
    pub fn center(&self, index: usize) -> Vec3 {
        self.block(index / BLOCK_SIZE).center(index % BLOCK_SIZE)
    }
}
