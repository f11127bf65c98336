//! Small functions that the x86 kernels share.

use std::arch::x86_64::*;

use super::super::LINE;
use crate::blocks::{Node, WIDTH};

/// Converts eight planes to floats.
///
/// # Safety
/// The machine of the caller has AVX2.
#[inline(always)]
pub(super) unsafe fn planes(bytes: &[u8; WIDTH]) -> __m256 {
    // SAFETY: eight bytes are read from an array of eight; AVX2 by contract.
    unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(bytes.as_ptr().cast()))) }
}

/// The boxes of the children in units of planes, in the form of [`PacketKernel::test_node_with_lanes`].
///
/// [`PacketKernel::test_node_with_lanes`]: super::super::PacketKernel::test_node_with_lanes
#[repr(align(32))]
pub(super) struct ChildBoxes {
    /// Midpoints, per axis and slot.
    pub(super) middle: [[f32; WIDTH]; 3],
    /// Half widths, per axis and slot.
    pub(super) half: [[f32; WIDTH]; 3],
}

impl ChildBoxes {
    /// # Safety
    /// The caller's machine has AVX2.
    #[inline(always)]
    pub(super) unsafe fn of(node: &Node) -> Self {
        let mut boxes = Self { middle: [[0.0; WIDTH]; 3], half: [[0.0; WIDTH]; 3] };
        for axis in 0..3 {
            // SAFETY: AVX2 by contract; stores fill arrays of eight.
            unsafe {
                let first = planes(&node.planes[axis][0]);
                let second = planes(&node.planes[axis][1]);
                let half = _mm256_set1_ps(0.5);
                let middle = _mm256_mul_ps(_mm256_add_ps(first, second), half);
                let half = _mm256_mul_ps(_mm256_sub_ps(second, first), half);
                _mm256_storeu_ps(boxes.middle[axis].as_mut_ptr(), middle);
                _mm256_storeu_ps(boxes.half[axis].as_mut_ptr(), half);
            }
        }
        boxes
    }
}

/// Broadcasts one lane (selected by `SHUFFLE`) to all eight.
///
/// # Safety
/// The machine of the caller has AVX2.
#[inline(always)]
pub(super) unsafe fn broadcast<const SHUFFLE: i32>(v: __m128) -> __m256 {
    // SAFETY: AVX2 by contract.
    unsafe {
        let lane = _mm_shuffle_ps::<SHUFFLE>(v, v);
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(lane), lane)
    }
}

/// Prefetches all cache lines of `value`.
#[inline(always)]
pub(super) fn prefetch<T>(value: &T) {
    for line in 0..size_of::<T>().div_ceil(LINE) {
        // SAFETY: a prefetch never faults, whatever the address; the cast keeps within or just past
        // `value`, by wrapping arithmetic.
        unsafe {
            let address = std::ptr::from_ref(value).cast::<i8>().wrapping_add(LINE * line);
            _mm_prefetch::<_MM_HINT_T0>(address);
        }
    }
}

/// # Safety
/// None beyond x86-64; unsafe as intrinsics outside a target feature are.
#[inline(always)]
pub(super) unsafe fn absolute(v: __m128) -> __m128 {
    // SAFETY: SSE2 is part of x86-64.
    unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), v) }
}

/// Keys of eight distances, without packing: see [`Kernel::Keys`].
///
/// # Safety
/// The machine of the caller has AVX2.
#[inline(always)]
pub(super) unsafe fn keys_of(distances: __m256) -> __m256i {
    // SAFETY: AVX2 by contract.
    unsafe {
        let slots = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let bits = _mm256_and_si256(_mm256_castps_si256(distances), _mm256_set1_epi32(!7));
        _mm256_or_si256(bits, slots)
    }
}

/// Stores all lanes to an array.
#[inline(always)]
pub(super) fn keys_to_array(keys: __m256i) -> [u32; WIDTH] {
    let mut array = [0; WIDTH];
    // SAFETY: AVX is there, or no kernel here would run; the store fills the array.
    unsafe { _mm256_storeu_si256(array.as_mut_ptr().cast(), keys) };
    array
}

/// The first two lanes, without a store to memory.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the two halves")]
pub(super) fn first_two(keys: __m256i) -> [u32; 2] {
    // SAFETY: SSE2 is part of x86-64.
    let pair = unsafe { _mm_cvtsi128_si64(_mm256_castsi256_si128(keys)) }.cast_unsigned();
    [pair as u32, (pair >> 32) as u32]
}
