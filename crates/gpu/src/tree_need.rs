//! Sizes of trees, and the memory that they need.

use crate::spheres::{Encoding, Grid};

/// Spheres in a block, the constant `BLOCK` of the shaders.
pub(crate) const BLOCK: u64 = 8;
/// Children of a node.
pub(crate) const WIDTH: u64 = 8;
/// Pairs that a workgroup sorts.
pub(crate) const TILE: u64 = 2048;
/// Largest number of spheres: their places have 28 bits for the block.
pub const MAX_SPHERES: u64 = BLOCK << 28;

/// Bytes of a sphere in the largest array of a tree.
pub(crate) const BYTES_OF_SPHERE: u64 = 16;

/// Number of spheres whose tree has no array larger than so many bytes.
const fn spheres_within(max_array: u64) -> u64 {
    let count = max_array / BYTES_OF_SPHERE;
    if count < MAX_SPHERES { count } else { MAX_SPHERES }
}

/// Centres in a block of a native frame.
const LANES: u64 = 16;

/// Bytes of the box of a block.
const BYTES_OF_BOX: u64 = 24;

/// Coded blocks whose boxes are computed together, with arrays of so many bytes: a multiple of [`WIDTH`], 1.6 GB at most.
pub(crate) fn blocks_of_part(max_array: u64) -> u64 {
    (max_array / BYTES_OF_BOX / WIDTH * WIDTH).clamp(WIDTH, 1 << 26)
}

/// Words of coded centres in an array of so many bytes: whole blocks in both encodings. Their numbers have 32 bits.
pub(crate) const fn largest_part(max_array: u64) -> u64 {
    let words = max_array / 4 / 48 * 48;
    if words < 1 << 30 { words } else { 1 << 30 }
}

/// Number of blocks of `count` spheres; an empty tree has one.
pub(crate) const fn block_count(count: u64) -> u64 {
    let blocks = count.div_ceil(BLOCK);
    if blocks == 0 { 1 } else { blocks }
}

/// Numbers of nodes of each level, from the lowest on.
pub(crate) fn level_sizes(blocks: u64) -> Vec<u64> {
    let mut sizes = vec![blocks.div_ceil(WIDTH)];
    while let Some(below) = sizes.last().filter(|below| **below > 1) {
        sizes.push(below.div_ceil(WIDTH));
    }
    sizes
}

/// What the memory of a tree depends on.
#[derive(Debug, Clone, Copy)]
pub struct TreeNeed {
    /// Number of spheres.
    pub count: u64,
    /// Whether they have the same radius.
    pub is_common: bool,
    /// Whether they move while the shutter is open.
    pub has_motion: bool,
    /// How their centres are stored.
    pub encoding: Encoding,
}

impl TreeNeed {
    /// Whether the centres have to stay coded, so that a device with arrays of so many bytes holds them.
    pub const fn keeps_codes(&self, max_array: u64) -> bool {
        let is_coded = matches!(self.encoding, Encoding::Q16 | Encoding::Q10);
        is_coded && self.is_common && !self.has_motion && self.count > spheres_within(max_array)
    }

    /// The largest number of such spheres that a device with arrays of so many bytes holds.
    pub fn max_count(&self, max_array: u64) -> u64 {
        let coded = Self { count: u64::MAX, ..*self };
        if !coded.keeps_codes(max_array) {
            return spheres_within(max_array);
        }
        let in_words = 2 * largest_part(max_array) / self.encoding.words() * LANES;
        let in_grids = max_array / size_of::<Grid>() as u64 * LANES;
        in_words.min(in_grids).min(MAX_SPHERES)
    }

    /// Memory of a device with arrays of so many bytes to build and trace the tree, bytes.
    pub fn bytes(&self, max_array: u64) -> u64 {
        let Self { count, is_common, has_motion, encoding } = *self;
        let blocks = block_count(count);
        let nodes: u64 = 64 * level_sizes(blocks).iter().sum::<u64>();
        let of_grids = if encoding.words() == 48 { 0 } else { size_of::<Grid>() as u64 };
        let of_centers = (4 * encoding.words() + of_grids) * count.div_ceil(LANES);
        if self.keeps_codes(max_array) {
            let boxes = 2 * BYTES_OF_BOX * blocks.min(blocks_of_part(max_array));
            return of_centers + nodes + boxes;
        }
        let radii = if is_common { 0 } else { 4 + 4 };
        let of_spheres = (2 * 8 + radii) * count + BYTES_OF_SPHERE * blocks * BLOCK;
        let of_motion = if has_motion { 12 * count + 16 * blocks * BLOCK } else { 0 };
        let of_sort = 1024 * count.div_ceil(TILE);
        of_centers + of_spheres + of_motion + of_sort + 48 * blocks + nodes
    }
}
