//! The 512-bit kernel.

use std::arch::x86_64::*;

use glam::Vec3;

use super::super::{BlockCrossings, Kernel};
use super::decode;
use super::lanes::{first_two, keys_of, keys_to_array, prefetch};
use super::slab::SlabRay;
use crate::blocks::{Block, BlockFrame, BlockRadii, Node, Q10Block, Q16Block, WIDTH};
use crate::ray::Ray;

/// The 512-bit kernel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Avx512;

pub(super) struct Avx512Ray {
    ray: Ray,
    slab: SlabRay,
    radius_squared: f32,
}

impl Avx512Ray {
    /// Midpoint of the chord and discriminant for all lanes.
    ///
    /// # Safety
    /// The machine of the caller has AVX-512 F.
    #[inline(always)]
    unsafe fn chords(&self, block: &Block, radii: Option<&BlockRadii>) -> (__m512, __m512) {
        let o = self.ray.origin;
        let d = self.ray.direction;
        // SAFETY: AVX-512 by contract; the loads are of arrays of 16 aligned to 64 bytes.
        unsafe {
            // Find the points of the ray nearest to the centres, and the vectors between them
            let cx = _mm512_sub_ps(_mm512_load_ps(block.x.as_ptr()), _mm512_set1_ps(o.x));
            let cy = _mm512_sub_ps(_mm512_load_ps(block.y.as_ptr()), _mm512_set1_ps(o.y));
            let cz = _mm512_sub_ps(_mm512_load_ps(block.z.as_ptr()), _mm512_set1_ps(o.z));
            let (dx, dy, dz) = (_mm512_set1_ps(d.x), _mm512_set1_ps(d.y), _mm512_set1_ps(d.z));
            let middle = _mm512_fmadd_ps(cz, dz, _mm512_fmadd_ps(cy, dy, _mm512_mul_ps(cx, dx)));
            let ax = _mm512_fnmadd_ps(middle, dx, cx);
            let ay = _mm512_fnmadd_ps(middle, dy, cy);
            let az = _mm512_fnmadd_ps(middle, dz, cz);
            let across = _mm512_fmadd_ps(az, az, _mm512_fmadd_ps(ay, ay, _mm512_mul_ps(ax, ax)));
            // Subtract the squared distances from the squared radii
            let squared = match radii {
                Some(radii) => {
                    let r = _mm512_load_ps(radii.0.as_ptr());
                    _mm512_mul_ps(r, r)
                }
                None => _mm512_set1_ps(self.radius_squared),
            };
            (middle, _mm512_sub_ps(squared, across))
        }
    }

    /// The hit distances, and the lanes with a distance in `t_min..=limit`.
    ///
    /// # Safety
    /// The machine of the caller has AVX-512 F.
    #[inline(always)]
    unsafe fn distances(
        &self,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> (__m512, __mmask16) {
        // SAFETY: AVX-512 by contract.
        unsafe {
            let (middle, discriminant) = self.chords(block, radii);
            let zero = _mm512_setzero_ps();
            let hit = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(discriminant, zero);
            if hit == 0 {
                return (zero, 0);
            }
            let chord = _mm512_sqrt_ps(_mm512_max_ps(discriminant, zero));
            // Choose the first intersection that does not lie before `t_min`
            let t_min = _mm512_set1_ps(self.ray.t_min);
            let near = _mm512_sub_ps(middle, chord);
            let far = _mm512_add_ps(middle, chord);
            let ahead = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(near, t_min);
            let t = _mm512_mask_blend_ps(ahead, far, near);
            // Keep the lanes with a distance in range
            let after = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(hit, t, t_min);
            let before = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(after, t, _mm512_set1_ps(limit));
            (t, before)
        }
    }
}

impl Kernel for Avx512 {
    type Ray = Avx512Ray;
    type Keys = __m256i;

    #[inline(always)]
    fn prepare(self, ray: &Ray, inverse: Vec3, radius: f32, padding: f32) -> Avx512Ray {
        Avx512Ray {
            ray: *ray,
            slab: SlabRay::new(ray, inverse, padding),
            radius_squared: radius * radius,
        }
    }

    /// Uses 256 bits as AVX2 does: a node has eight children, and the 512-bit form (both sides of an axis in one
    /// register) has a longer dependency chain from load to branch.
    #[inline(always)]
    fn test_node(self, ray: &Avx512Ray, node: &Node, limit: f32) -> (usize, __m256i) {
        // SAFETY: this kernel is only used inside functions with AVX-512 F, BW, DQ and VL.
        unsafe {
            let (near, far) = ray.slab.test(node, limit);
            let mask = _mm256_mask_cmp_ps_mask::<_CMP_LE_OQ>(node.child_mask, near, far);
            let packed = _mm256_maskz_compress_epi32(mask, keys_of(near));
            (mask.count_ones() as usize, packed)
        }
    }

    #[inline(always)]
    fn first_two(self, keys: __m256i) -> [u32; 2] {
        first_two(keys)
    }

    #[inline(always)]
    fn all_keys(self, keys: __m256i) -> [u32; WIDTH] {
        keys_to_array(keys)
    }

    #[inline(always)]
    fn nearest_in_block(
        self,
        ray: &Avx512Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)> {
        // SAFETY: this kernel is only used inside functions with AVX-512.
        unsafe {
            let (t, lanes) = ray.distances(block, radii, limit);
            if lanes == 0 {
                return None;
            }
            // Find the nearest distance and all lanes with it
            let best = _mm512_mask_reduce_min_ps(lanes, t);
            let tied = _mm512_mask_cmp_ps_mask::<_CMP_EQ_OQ>(lanes, t, _mm512_set1_ps(best));
            Some((best, u32::from(tied)))
        }
    }

    #[inline(always)]
    fn any_in_block(
        self,
        ray: &Avx512Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> bool {
        // SAFETY: this kernel is only used inside functions with AVX-512.
        unsafe { ray.distances(block, radii, limit).1 != 0 }
    }

    #[inline(always)]
    fn all_in_block(
        self,
        ray: &Avx512Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
    ) -> BlockCrossings {
        let mut found = BlockCrossings::NONE;
        // SAFETY: this kernel is only used inside functions with AVX-512; stores fill arrays of 16.
        unsafe {
            let (middle, discriminant) = ray.chords(block, radii);
            let zero = _mm512_setzero_ps();
            let hit = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(discriminant, zero);
            let chord = _mm512_sqrt_ps(_mm512_max_ps(discriminant, zero));
            found.lanes = u32::from(hit);
            _mm512_storeu_ps(found.near.as_mut_ptr(), _mm512_sub_ps(middle, chord));
            _mm512_storeu_ps(found.far.as_mut_ptr(), _mm512_add_ps(middle, chord));
        }
        found
    }

    #[inline(always)]
    fn decode_q10(self, block: &Q10Block, frame: &BlockFrame) -> Block {
        // SAFETY: this kernel is only used inside functions with AVX-512.
        unsafe { decode::q10_by_16(block, frame) }
    }

    #[inline(always)]
    fn decode_q16(self, block: &Q16Block, frame: &BlockFrame) -> Block {
        // SAFETY: this kernel is only used inside functions with AVX-512.
        unsafe { decode::q16_by_16(block, frame) }
    }

    #[inline(always)]
    fn prefetch<T>(self, value: &T) {
        prefetch(value);
    }
}
