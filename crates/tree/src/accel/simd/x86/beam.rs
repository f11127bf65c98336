//! Tests the eight boxes of a node with the beam of a packet.

use std::arch::x86_64::*;

use super::super::{Beam, SLAB_SLACK};
use super::lanes::{absolute, broadcast, planes};
use crate::blocks::Node;

/// Where the first ray may enter and the last ray may leave each child of `node`, between the `t_min` of the beam and
/// `limit`.
///
/// # Safety
/// The machine of the caller has AVX2 and FMA.
#[inline(always)]
pub(super) unsafe fn test(beam: &Beam, node: &Node, limit: f32) -> (__m256, __m256) {
    // SAFETY: AVX2 and FMA by contract. The 16 bytes read from the node's start are its origin,
    // exponents and mask, within its 64 bytes; the beam's loads are of arrays of four, aligned to 16
    // bytes as its first fields are. Plane loads are of eight bytes out of arrays of eight.
    unsafe {
        // Load origin and exponents of the node
        let header = _mm_load_si128(std::ptr::from_ref(node).cast());
        let origin_near = _mm_loadu_ps(beam.origin_near.as_ptr());
        let origin_far = _mm_loadu_ps(beam.origin_far.as_ptr());
        // The fourth lane is zero throughout, as in the test for single rays.
        let origin = _mm_blend_ps::<0b1000>(_mm_castsi128_ps(header), origin_near);
        let exponent_bytes = _mm_setr_epi32(0, 0, 0, 0x00ff_ffff);
        let exponents =
            _mm_cvtepu8_epi32(_mm_srli_si128::<12>(_mm_and_si128(header, exponent_bytes)));
        let step = _mm_castsi128_ps(_mm_slli_epi32::<23>(exponents));
        // Compute the distance of the node from the bounds of the origins, with slack
        let from_near = _mm_sub_ps(origin, origin_near);
        let from_far = _mm_sub_ps(origin, origin_far);
        let terms = _mm_max_ps(absolute(from_near), absolute(from_far));
        let terms = _mm_fmadd_ps(step, _mm_set1_ps(255.0), terms);
        let padding = _mm_set1_ps(beam.padding);
        let slack = _mm_fmadd_ps(terms, _mm_set1_ps(SLAB_SLACK), padding);
        let slack = _mm_mul_ps(slack, _mm_loadu_ps(beam.sign.as_ptr()));
        let from_near = _mm_sub_ps(from_near, slack);
        let from_far = _mm_add_ps(from_far, slack);
        // Clip to the slabs of all children axis by axis, with interval arithmetic over the inverse directions
        let mut near = _mm256_set1_ps(beam.t_min);
        let mut far = _mm256_set1_ps(limit);
        macro_rules! axis {
            ($axis:literal, $lanes:literal) => {
                let side = beam.near_side[$axis];
                let step = broadcast::<$lanes>(step);
                let first = planes(&node.planes[$axis][side]);
                let second = planes(&node.planes[$axis][1 - side]);
                let first = _mm256_fmadd_ps(first, step, broadcast::<$lanes>(from_near));
                let second = _mm256_fmadd_ps(second, step, broadcast::<$lanes>(from_far));
                let least = _mm256_set1_ps(beam.inverse[0][$axis]);
                let greatest = _mm256_set1_ps(beam.inverse[1][$axis]);
                let enter =
                    _mm256_min_ps(_mm256_mul_ps(first, least), _mm256_mul_ps(first, greatest));
                let leave = _mm256_max_ps(
                    _mm256_mul_ps(second, least),
                    _mm256_mul_ps(second, greatest),
                );
                // If the first operand is NaN (planes beyond the range of f32), the result is the second one: no bound.
                near = _mm256_max_ps(enter, near);
                far = _mm256_min_ps(leave, far);
            };
        }
        axis!(0, 0x00);
        axis!(1, 0x55);
        axis!(2, 0xaa);
        (near, far)
    }
}
