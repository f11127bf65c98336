//! The leaves of a tree as a native frame has them: plain arrays in a file that is mapped.

use glam::Vec3;

use super::{
    BLOCK_SIZE, Block, BlockFrame, BlockRadii, CompactBlock, Node, Q10Block, Q16Block, WIDTH,
};

/// Leaves in place. Lengths fit each other (`count` particles fill so many blocks, these so many
/// nodes); the contents are those of a file and may be anything.
#[derive(Debug, Clone, Copy)]
pub struct StoredLeaves<'a> {
    /// Particles.
    pub count: u64,
    /// One node for eight blocks: boxes of the centres, or of the spheres where radii differ.
    pub nodes: &'a [Node],
    /// Positions, [`BLOCK_SIZE`] in a block.
    pub blocks: StoredBlocks<'a>,
    /// Radii.
    pub radii: StoredRadii<'a>,
}

/// Positions by encoding.
#[derive(Debug, Clone, Copy)]
pub enum StoredBlocks<'a> {
    /// As they are.
    F32(&'a [Block]),
    /// 16 bits an axis.
    Q16(CompactBlocks<'a, Q16Block>),
    /// 11, 11 and 10 bits.
    Q10(CompactBlocks<'a, Q10Block>),
}

/// Coded blocks and those that could not be coded.
#[derive(Debug, Clone, Copy)]
pub struct CompactBlocks<'a, B> {
    /// All blocks, coded or referring.
    pub blocks: &'a [B],
    /// Those that are referred to.
    pub wide: &'a [Block],
}

/// Radii by encoding; `low + code * step` where they are coded.
#[derive(Debug, Clone, Copy)]
pub enum StoredRadii<'a> {
    /// All alike, or unknown: none here.
    None,
    /// As they are.
    F32(&'a [BlockRadii]),
    /// 16 bits.
    U16 {
        /// Codes, a block after the other.
        codes: &'a [[u16; BLOCK_SIZE]],
        /// Radius of code 0.
        low: f32,
        /// Radius between codes.
        step: f32,
    },
    /// 8 bits.
    U8 {
        /// Codes, a block after the other.
        codes: &'a [[u8; BLOCK_SIZE]],
        /// Radius of code 0.
        low: f32,
        /// Radius between codes.
        step: f32,
    },
}

impl<B: CompactBlock> CompactBlocks<'_, B> {
    /// The positions of block `index` in its grid `frame`. A reference to a block that is not
    /// there, which only a damaged file has, gives the block decoded as if it were coded.
    ///
    /// # Panics
    /// If there is no block `index`.
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
    /// Radii of block `index`; `None` where they are not stored.
    ///
    /// # Panics
    /// If there is no block `index`.
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
    /// If there is no block `index`.
    pub fn block(&self, index: usize) -> Block {
        let frame = self.nodes[index / WIDTH].child_frame(index % WIDTH);
        match &self.blocks {
            StoredBlocks::F32(blocks) => blocks[index],
            StoredBlocks::Q16(compact) => compact.load(index, &frame),
            StoredBlocks::Q10(compact) => compact.load(index, &frame),
        }
    }

    /// Blocks.
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
    /// If there is no such particle.
    pub fn center(&self, index: usize) -> Vec3 {
        self.block(index / BLOCK_SIZE).center(index % BLOCK_SIZE)
    }
}
