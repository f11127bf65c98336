//! Decodes coded blocks into registers. The width and position of the stores equal those of the loads in the tests,
//! so that the block needs no memory once both are inlined.
//!
//! A position is a product and a sum, each rounded and never fused, as in
//! [`crate::blocks::CompactBlock::decode`].

use std::arch::x86_64::*;

use crate::blocks::{BLOCK_SIZE, Block, BlockFrame, CompactBlock, Q10Block, Q16Block};
use bytemuck::Zeroable;

/// # Safety
/// The caller's machine has AVX-512 F.
#[inline(always)]
pub(super) unsafe fn q10_by_16(coded: &Q10Block, frame: &BlockFrame) -> Block {
    let steps = Q10Block::steps(frame);
    let mut block = Block::zeroed();
    // SAFETY: AVX-512 by contract; loads and stores are of arrays of 16, aligned to 64 bytes.
    unsafe {
        // Extract the codes of x, y and z: 11, 11 and 10 bits
        let words = _mm512_load_si512(coded.0.as_ptr().cast());
        let low_11_bits = _mm512_set1_epi32(2047);
        let x = _mm512_and_si512(words, low_11_bits);
        let y = _mm512_and_si512(_mm512_srli_epi32::<11>(words), low_11_bits);
        let z = _mm512_srli_epi32::<22>(words);
        for (axis, (codes, lanes)) in
            [(x, &mut block.x), (y, &mut block.y), (z, &mut block.z)].into_iter().enumerate()
        {
            _mm512_store_ps(lanes.as_mut_ptr(), place_16(codes, frame.base[axis], steps[axis]));
        }
    }
    block
}

/// # Safety
/// The caller's machine has AVX-512 F.
#[inline(always)]
pub(super) unsafe fn q16_by_16(coded: &Q16Block, frame: &BlockFrame) -> Block {
    let steps = Q16Block::steps(frame);
    let mut block = Block::zeroed();
    let axes = [(&coded.x, &mut block.x), (&coded.y, &mut block.y), (&coded.z, &mut block.z)];
    for (axis, (codes, lanes)) in axes.into_iter().enumerate() {
        // SAFETY: AVX-512 by contract; loads and stores are of arrays of 16, aligned to 32 and 64 bytes.
        unsafe {
            let codes = _mm512_cvtepu16_epi32(_mm256_load_si256(codes.as_ptr().cast()));
            _mm512_store_ps(lanes.as_mut_ptr(), place_16(codes, frame.base[axis], steps[axis]));
        }
    }
    block
}

/// # Safety
/// The caller's machine has AVX-512 F.
#[inline(always)]
unsafe fn place_16(codes: __m512i, base: f32, step: f32) -> __m512 {
    // SAFETY: AVX-512 by contract.
    unsafe {
        let offset = _mm512_mul_ps(_mm512_cvtepi32_ps(codes), _mm512_set1_ps(step));
        _mm512_add_ps(_mm512_set1_ps(base), offset)
    }
}

/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
pub(super) unsafe fn q10_by_8(coded: &Q10Block, frame: &BlockFrame) -> Block {
    let steps = Q10Block::steps(frame);
    let mut block = Block::zeroed();
    for first in (0..BLOCK_SIZE).step_by(8) {
        // SAFETY: AVX2 by contract; loads and stores are of lanes 0..8 or 8..16 of 16, aligned to 32
        // bytes.
        unsafe {
            // Extract the codes of x, y and z: 11, 11 and 10 bits
            let words = _mm256_load_si256(coded.0.as_ptr().add(first).cast());
            let low_11_bits = _mm256_set1_epi32(2047);
            let x = _mm256_and_si256(words, low_11_bits);
            let y = _mm256_and_si256(_mm256_srli_epi32::<11>(words), low_11_bits);
            let z = _mm256_srli_epi32::<22>(words);
            for (axis, (codes, lanes)) in
                [(x, &mut block.x), (y, &mut block.y), (z, &mut block.z)].into_iter().enumerate()
            {
                _mm256_store_ps(
                    lanes.as_mut_ptr().add(first),
                    place_8(codes, frame.base[axis], steps[axis]),
                );
            }
        }
    }
    block
}

/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
pub(super) unsafe fn q16_by_8(coded: &Q16Block, frame: &BlockFrame) -> Block {
    let steps = Q16Block::steps(frame);
    let mut block = Block::zeroed();
    let axes = [(&coded.x, &mut block.x), (&coded.y, &mut block.y), (&coded.z, &mut block.z)];
    for (axis, (codes, lanes)) in axes.into_iter().enumerate() {
        for first in [0, 8] {
            // SAFETY: AVX2 by contract; loads and stores are of lanes 0..8 or 8..16 of 16, aligned to 16
            // and 32 bytes.
            unsafe {
                let eight = _mm_load_si128(codes.as_ptr().add(first).cast());
                let codes = _mm256_cvtepu16_epi32(eight);
                _mm256_store_ps(
                    lanes.as_mut_ptr().add(first),
                    place_8(codes, frame.base[axis], steps[axis]),
                );
            }
        }
    }
    block
}

/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
unsafe fn place_8(codes: __m256i, base: f32, step: f32) -> __m256 {
    // SAFETY: AVX2 by contract.
    unsafe {
        let offset = _mm256_mul_ps(_mm256_cvtepi32_ps(codes), _mm256_set1_ps(step));
        _mm256_add_ps(_mm256_set1_ps(base), offset)
    }
}
