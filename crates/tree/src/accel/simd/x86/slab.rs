//! Tests the eight boxes of a node with one ray.

use std::arch::x86_64::*;

use glam::Vec3;

use super::super::SLAB_SLACK;
use super::lanes::{absolute, broadcast, planes};
use crate::blocks::Node;
use crate::ray::Ray;

/// A ray prepared for the slab test: one lane per axis, the fourth unused.
#[derive(Clone, Copy)]
pub(super) struct SlabRay {
    origin: __m128,
    inverse: __m128,
    /// Distance along the ray that the padding of boxes adds on either side, per axis.
    reach: __m128,
    /// Index of the near planes per axis: 1 if the direction is negative.
    near_side: [usize; 3],
    t_min: f32,
}

/// Step, base and slack of the planes of a node as distances along the ray, per axis.
struct SlabNode {
    step: __m128,
    base: __m128,
    slack: __m128,
}

impl SlabRay {
    #[inline(always)]
    pub(super) fn new(ray: &Ray, inverse: Vec3, padding: f32) -> Self {
        let reach = inverse.abs() * padding;
        // SAFETY: SSE2 is part of x86-64.
        unsafe {
            Self {
                origin: _mm_setr_ps(ray.origin.x, ray.origin.y, ray.origin.z, 0.0),
                inverse: _mm_setr_ps(inverse.x, inverse.y, inverse.z, 1.0),
                reach: _mm_setr_ps(reach.x, reach.y, reach.z, 0.0),
                near_side: inverse.to_array().map(|d| usize::from(d.is_sign_negative())),
                t_min: ray.t_min.max(0.0),
            }
        }
    }

    #[inline(always)]
    fn enter(&self, node: &Node) -> SlabNode {
        // SAFETY: SSE4.1 and FMA are there, or no kernel here would run. The 16 bytes read from the
        // node's start are its origin, exponents and mask: within its 64 bytes.
        unsafe {
            // Load origin and exponents of the node
            let header = _mm_load_si128(std::ptr::from_ref(node).cast());
            // The fourth lane is zero throughout: other content would lead to denormal products, each of which costs
            // over a hundred cycles on Intel processors.
            let origin = _mm_blend_ps::<0b1000>(_mm_castsi128_ps(header), self.origin);
            let exponent_bytes = _mm_setr_epi32(0, 0, 0, 0x00ff_ffff);
            let exponents =
                _mm_cvtepu8_epi32(_mm_srli_si128::<12>(_mm_and_si128(header, exponent_bytes)));
            let scale = _mm_castsi128_ps(_mm_slli_epi32::<23>(exponents));
            // Convert the grid of the node to distances along the ray
            let step = _mm_mul_ps(scale, self.inverse);
            let base = _mm_mul_ps(_mm_sub_ps(origin, self.origin), self.inverse);
            // Compute the slack; the part that does not depend on the origin comes first, which shortens the
            // dependency chain.
            let fixed = _mm_fmadd_ps(absolute(step), _mm_set1_ps(255.0 * SLAB_SLACK), self.reach);
            let slack = _mm_fmadd_ps(absolute(base), _mm_set1_ps(SLAB_SLACK), fixed);
            SlabNode { step, base, slack }
        }
    }

    /// Where the ray enters and leaves each child of `node`, between its `t_min` and `limit`.
    ///
    /// # Safety
    /// The machine of the caller has AVX2 and FMA.
    #[inline(always)]
    pub(super) unsafe fn test(&self, node: &Node, limit: f32) -> (__m256, __m256) {
        // SAFETY: AVX2 and FMA by contract. Plane loads are of eight bytes out of arrays of eight.
        unsafe {
            let slab = self.enter(node);
            let low = _mm_sub_ps(slab.base, slab.slack);
            let high = _mm_add_ps(slab.base, slab.slack);
            // Clip the ray to the slabs of all children, axis by axis
            let mut near = _mm256_set1_ps(self.t_min);
            let mut far = _mm256_set1_ps(limit);
            macro_rules! axis {
                ($axis:literal, $lanes:literal) => {
                    let side = self.near_side[$axis];
                    let step = broadcast::<$lanes>(slab.step);
                    let enter = planes(&node.planes[$axis][side]);
                    let leave = planes(&node.planes[$axis][1 - side]);
                    let enter = _mm256_fmadd_ps(enter, step, broadcast::<$lanes>(low));
                    let leave = _mm256_fmadd_ps(leave, step, broadcast::<$lanes>(high));
                    // If the first operand is NaN (planes beyond the range of f32), the result is the second one: no
                    // bound.
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
}
