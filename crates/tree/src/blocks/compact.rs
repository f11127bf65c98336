//! Blocks whose positions are integers on a grid: 4 or 6 bytes per particle.
//!
//! The grid of a block spans the quantised box that its node stores anyway, so that it costs no memory. A
//! coordinate is `base + code * (extent / largest code)`. Each operation is rounded once to f32, so that all
//! kernels compute the same bits.
//!
//! A block whose positions would be too coarse is stored as f32 elsewhere, and the coded block refers to it by
//! its index. This needs no flag: the lanes of a coded block are arranged so that z of the first is not above z
//! of the last, and a reference has them the other way round.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::{BLOCK_SIZE, Block, Node};

/// The grid of the codes of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockFrame {
    /// Position of code 0 on each axis.
    pub base: [f32; 3],
    /// Distance from `base` to the position of the largest code, on each axis.
    pub extent: [f32; 3],
}

impl Node {
    /// The grid of the block in child `slot`: from its lower to its upper planes.
    #[inline(always)]
    pub fn child_frame(&self, slot: usize) -> BlockFrame {
        let mut frame = BlockFrame { base: [0.0; 3], extent: [0.0; 3] };
        for axis in 0..3 {
            let step = f32::from_bits(u32::from(self.exponent[axis]) << 23);
            let [lower, upper] = [0, 1].map(|side| self.planes[axis][side][slot & 7]);
            // A product of eight bits and a power of two is exact, so that each value is rounded only once.
            frame.base[axis] = self.origin[axis] + f32::from(lower) * step;
            frame.extent[axis] = f32::from(upper.saturating_sub(lower)) * step;
        }
        frame
    }
}

/// A coded block: the interface of both encodings.
pub trait CompactBlock: Pod {
    /// Largest code on each axis.
    const LARGEST: [u32; 3];

    /// The block with these codes, `[axis][lane]`, none above [`Self::LARGEST`].
    fn from_codes(codes: &[[u32; BLOCK_SIZE]; 3]) -> Self;

    /// The codes of the particle in `lane`.
    fn codes(&self, lane: usize) -> [u32; 3];

    /// A reference to the block that is stored as f32 at `index`.
    fn referring_to(index: u32) -> Self;

    /// The index of the block stored as f32, if this block is a reference.
    fn wide_index(&self) -> Option<u32>;

    /// Length of a step of the grid on each axis.
    #[inline(always)]
    fn steps(frame: &BlockFrame) -> [f32; 3] {
        std::array::from_fn(|axis| frame.extent[axis] * (1.0 / Self::LARGEST[axis] as f32))
    }

    /// The decoded positions; meaningless for a reference.
    #[inline(always)]
    fn decode(&self, frame: &BlockFrame) -> Block {
        let steps = Self::steps(frame);
        let mut block = Block::zeroed();
        for lane in 0..BLOCK_SIZE {
            let [x, y, z] = self.codes(lane);
            block.x[lane] = frame.base[0] + x as f32 * steps[0];
            block.y[lane] = frame.base[1] + y as f32 * steps[1];
            block.z[lane] = frame.base[2] + z as f32 * steps[2];
        }
        block
    }

    /// The position of one particle, the same as in [`Self::decode`].
    #[inline(always)]
    fn center(&self, frame: &BlockFrame, lane: usize) -> Vec3 {
        let (codes, steps) = (self.codes(lane), Self::steps(frame));
        Vec3::from_array(std::array::from_fn(|axis| {
            frame.base[axis] + codes[axis] as f32 * steps[axis]
        }))
    }
}

/// 4 bytes per particle: 11 bits of x (the lowest), 11 of y, 10 of z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Q10Block(pub [u32; BLOCK_SIZE]);

impl CompactBlock for Q10Block {
    const LARGEST: [u32; 3] = [2047, 2047, 1023];

    fn from_codes(codes: &[[u32; BLOCK_SIZE]; 3]) -> Self {
        let [x, y, z] = codes;
        Self(std::array::from_fn(|lane| x[lane] | y[lane] << 11 | z[lane] << 22))
    }

    #[inline(always)]
    fn codes(&self, lane: usize) -> [u32; 3] {
        let word = self.0[lane];
        [word & 2047, word >> 11 & 2047, word >> 22]
    }

    fn referring_to(index: u32) -> Self {
        let mut words = [0; BLOCK_SIZE];
        words[0] = 1023 << 22;
        words[1] = index;
        Self(words)
    }

    #[inline(always)]
    fn wide_index(&self) -> Option<u32> {
        (self.0[0] >> 22 > self.0[BLOCK_SIZE - 1] >> 22).then_some(self.0[1])
    }
}

/// 6 bytes per particle: 16 bits per axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Q16Block {
    /// Codes of x.
    pub x: [u16; BLOCK_SIZE],
    /// Codes of y.
    pub y: [u16; BLOCK_SIZE],
    /// Codes of z.
    pub z: [u16; BLOCK_SIZE],
}

impl CompactBlock for Q16Block {
    const LARGEST: [u32; 3] = [65_535; 3];

    #[expect(clippy::cast_possible_truncation, reason = "codes have 16 bits")]
    fn from_codes(codes: &[[u32; BLOCK_SIZE]; 3]) -> Self {
        let [x, y, z] = codes.map(|axis| axis.map(|code| code as u16));
        Self { x, y, z }
    }

    #[inline(always)]
    fn codes(&self, lane: usize) -> [u32; 3] {
        [&self.x, &self.y, &self.z].map(|axis| u32::from(axis[lane]))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the two halves")]
    fn referring_to(index: u32) -> Self {
        let mut block = Self::zeroed();
        block.z[0] = u16::MAX;
        (block.x[0], block.x[1]) = (index as u16, (index >> 16) as u16);
        block
    }

    #[inline(always)]
    fn wide_index(&self) -> Option<u32> {
        (self.z[0] > self.z[BLOCK_SIZE - 1])
            .then(|| u32::from(self.x[0]) | u32::from(self.x[1]) << 16)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::blocks::Aabb;

    fn there_and_back<B: CompactBlock>(words: [[u32; BLOCK_SIZE]; 3]) {
        let mut codes = words;
        for (axis, largest) in B::LARGEST.iter().enumerate() {
            codes[axis] = codes[axis].map(|word| word % (largest + 1));
        }
        if codes[2][0] > codes[2][BLOCK_SIZE - 1] {
            codes[2].swap(0, BLOCK_SIZE - 1);
        }
        let block = B::from_codes(&codes);
        assert_eq!(block.wide_index(), None);
        let [x, y, z] = codes;
        for (lane, ((x, y), z)) in x.into_iter().zip(y).zip(z).enumerate() {
            assert_eq!(block.codes(lane), [x, y, z]);
        }
    }

    proptest! {
        #[test]
        fn codes_round_trip(words: [[u32; BLOCK_SIZE]; 3]) {
            there_and_back::<Q10Block>(words);
            there_and_back::<Q16Block>(words);
        }

        #[test]
        fn references_round_trip(index: u32) {
            prop_assert_eq!(Q10Block::referring_to(index).wide_index(), Some(index));
            prop_assert_eq!(Q16Block::referring_to(index).wide_index(), Some(index));
        }
    }

    #[test]
    fn the_grid_spans_the_quantised_box() {
        let child = Aabb { min: Vec3::new(1.0, -2.0, 100.0), max: Vec3::new(1.5, -1.0, 100.0) };
        let other = Aabb { min: Vec3::ZERO, max: Vec3::splat(3.0) };
        let node = Node::enclosing(&[other, child]);
        let frame = node.child_frame(1);
        for axis in 0..3 {
            let [lower, upper] = node.interval(1, axis);
            let base = f64::from(frame.base[axis]);
            assert_eq!(base, lower);
            assert_eq!(base + f64::from(frame.extent[axis]), upper);
        }
        let mut codes = [[0; BLOCK_SIZE]; 3];
        codes[0][3] = 2047;
        let block = Q10Block::from_codes(&codes).decode(&frame);
        assert_eq!(block.center(0), Vec3::from_array(frame.base));
        assert!((block.x[3] - (frame.base[0] + frame.extent[0])).abs() < 1e-6);
    }
}
