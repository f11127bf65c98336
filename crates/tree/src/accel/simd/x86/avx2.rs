//! The 256-bit kernel.

use std::arch::x86_64::*;

use glam::Vec3;

use super::super::{BlockCrossings, Kernel};
use super::decode;
use super::lanes::{first_two, keys_of, keys_to_array, prefetch};
use super::slab::SlabRay;
use crate::blocks::{BLOCK_SIZE, Block, BlockFrame, BlockRadii, Node, Q10Block, Q16Block, WIDTH};
use crate::ray::Ray;

/// The 256-bit kernel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Avx2;

pub(super) struct Avx2Ray {
    ray: Ray,
    slab: SlabRay,
    radius_squared: f32,
}

impl Avx2Ray {
    /// Midpoint of the chord and discriminant for lanes `half * 8 .. half * 8 + 8`.
    ///
    /// # Safety
    /// The machine of the caller has AVX2 and FMA.
    #[inline(always)]
    unsafe fn chords(
        &self,
        block: &Block,
        radii: Option<&BlockRadii>,
        half: usize,
    ) -> (__m256, __m256) {
        let o = self.ray.origin;
        let d = self.ray.direction;
        // SAFETY: AVX2 and FMA by contract; the loads are of lanes 0..8 or 8..16 of 16.
        unsafe {
            let load = |v: &[f32; BLOCK_SIZE]| _mm256_load_ps(v.as_ptr().add(half * 8));
            // Find the points of the ray nearest to the centres, and the vectors between them
            let cx = _mm256_sub_ps(load(&block.x), _mm256_set1_ps(o.x));
            let cy = _mm256_sub_ps(load(&block.y), _mm256_set1_ps(o.y));
            let cz = _mm256_sub_ps(load(&block.z), _mm256_set1_ps(o.z));
            let (dx, dy, dz) = (_mm256_set1_ps(d.x), _mm256_set1_ps(d.y), _mm256_set1_ps(d.z));
            let middle = _mm256_fmadd_ps(cz, dz, _mm256_fmadd_ps(cy, dy, _mm256_mul_ps(cx, dx)));
            let ax = _mm256_fnmadd_ps(middle, dx, cx);
            let ay = _mm256_fnmadd_ps(middle, dy, cy);
            let az = _mm256_fnmadd_ps(middle, dz, cz);
            let across = _mm256_fmadd_ps(az, az, _mm256_fmadd_ps(ay, ay, _mm256_mul_ps(ax, ax)));
            // Subtract the squared distances from the squared radii
            let squared = match radii {
                Some(radii) => {
                    let r = load(&radii.0);
                    _mm256_mul_ps(r, r)
                }
                None => _mm256_set1_ps(self.radius_squared),
            };
            (middle, _mm256_sub_ps(squared, across))
        }
    }

    /// The hit distances, and the lanes with a distance in `t_min..=limit`.
    ///
    /// # Safety
    /// The machine of the caller has AVX2 and FMA.
    #[inline(always)]
    unsafe fn distances(
        &self,
        block: &Block,
        radii: Option<&BlockRadii>,
        half: usize,
        limit: f32,
    ) -> (__m256, u32) {
        // SAFETY: AVX2 and FMA by contract.
        unsafe {
            let (middle, discriminant) = self.chords(block, radii, half);
            let zero = _mm256_setzero_ps();
            let hit = _mm256_cmp_ps::<_CMP_GE_OQ>(discriminant, zero);
            if _mm256_movemask_ps(hit) == 0 {
                return (zero, 0);
            }
            let chord = _mm256_sqrt_ps(_mm256_max_ps(discriminant, zero));
            // Choose the first intersection that does not lie before `t_min`
            let t_min = _mm256_set1_ps(self.ray.t_min);
            let near = _mm256_sub_ps(middle, chord);
            let far = _mm256_add_ps(middle, chord);
            let ahead = _mm256_cmp_ps::<_CMP_GE_OQ>(near, t_min);
            let t = _mm256_blendv_ps(far, near, ahead);
            // Keep the lanes with a distance in range
            let after = _mm256_cmp_ps::<_CMP_GE_OQ>(t, t_min);
            let before = _mm256_cmp_ps::<_CMP_LE_OQ>(t, _mm256_set1_ps(limit));
            let valid = _mm256_and_ps(hit, _mm256_and_ps(after, before));
            (t, _mm256_movemask_ps(valid).cast_unsigned())
        }
    }
}

impl Kernel for Avx2 {
    type Ray = Avx2Ray;
    type Keys = __m256i;

    #[inline(always)]
    fn prepare(self, ray: &Ray, inverse: Vec3, radius: f32, padding: f32) -> Avx2Ray {
        Avx2Ray {
            ray: *ray,
            slab: SlabRay::new(ray, inverse, padding),
            radius_squared: radius * radius,
        }
    }

    #[inline(always)]
    fn test_node(self, ray: &Avx2Ray, node: &Node, limit: f32) -> (usize, __m256i) {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            let (near, far) = ray.slab.test(node, limit);
            packed_keys(node, near, far)
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
        ray: &Avx2Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)> {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            // Test both halves of the block
            let (t_low, lanes_low) = ray.distances(block, radii, 0, limit);
            let (t_high, lanes_high) = ray.distances(block, radii, 1, limit);
            let mut lanes = lanes_low | (lanes_high << 8);
            if lanes == 0 {
                return None;
            }
            let mut t = [0.0_f32; BLOCK_SIZE];
            _mm256_storeu_ps(t.as_mut_ptr(), t_low);
            _mm256_storeu_ps(t.as_mut_ptr().add(8), t_high);
            // Find the nearest distance and all lanes with it
            let (mut best, mut tied) = (f32::INFINITY, 0);
            while lanes != 0 {
                let lane = lanes.trailing_zeros();
                lanes &= lanes - 1;
                let distance = t[lane as usize & 15];
                if distance <= best {
                    tied = if distance < best { 0 } else { tied } | (1 << lane);
                    best = distance;
                }
            }
            Some((best, tied))
        }
    }

    #[inline(always)]
    fn any_in_block(
        self,
        ray: &Avx2Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> bool {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            ray.distances(block, radii, 0, limit).1 != 0
                || ray.distances(block, radii, 1, limit).1 != 0
        }
    }

    #[inline(always)]
    fn all_in_block(
        self,
        ray: &Avx2Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
    ) -> BlockCrossings {
        let mut found = BlockCrossings::NONE;
        for half in 0..2 {
            // SAFETY: this kernel is only used inside functions with AVX2 and FMA; stores go to
            // lanes 0..8 or 8..16 of 16.
            unsafe {
                let (middle, discriminant) = ray.chords(block, radii, half);
                let zero = _mm256_setzero_ps();
                let hit = _mm256_cmp_ps::<_CMP_GE_OQ>(discriminant, zero);
                let chord = _mm256_sqrt_ps(_mm256_max_ps(discriminant, zero));
                found.lanes |= _mm256_movemask_ps(hit).cast_unsigned() << (half * 8);
                let near = found.near.as_mut_ptr().add(half * 8);
                let far = found.far.as_mut_ptr().add(half * 8);
                _mm256_storeu_ps(near, _mm256_sub_ps(middle, chord));
                _mm256_storeu_ps(far, _mm256_add_ps(middle, chord));
            }
        }
        found
    }

    #[inline(always)]
    fn decode_q10(self, block: &Q10Block, frame: &BlockFrame) -> Block {
        // SAFETY: this kernel is only used inside functions with AVX2.
        unsafe { decode::q10_by_8(block, frame) }
    }

    #[inline(always)]
    fn decode_q16(self, block: &Q16Block, frame: &BlockFrame) -> Block {
        // SAFETY: this kernel is only used inside functions with AVX2.
        unsafe { decode::q16_by_8(block, frame) }
    }

    #[inline(always)]
    fn prefetch<T>(self, value: &T) {
        prefetch(value);
    }
}

/// The indices of the set lanes for each mask of eight lanes, because AVX2 has no compress instruction.
const COMPRESSED: [[u8; WIDTH]; 256] = {
    let mut table = [[0; WIDTH]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut found) = (0, 0);
        while lane < 8 {
            if mask & (1 << lane) != 0 {
                table[mask][found] = lane;
                found += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// The number of children of `node` whose entry distance does not exceed their exit distance, and their keys, packed.
///
/// # Safety
/// The machine of the caller has AVX2.
#[inline(always)]
pub(super) unsafe fn packed_keys(node: &Node, near: __m256, far: __m256) -> (usize, __m256i) {
    // SAFETY: AVX2 by contract; eight bytes are read from an array of eight.
    unsafe {
        let entered = _mm256_cmp_ps::<_CMP_LE_OQ>(near, far);
        let mask = _mm256_movemask_ps(entered).cast_unsigned() & u32::from(node.child_mask);
        let order = COMPRESSED[mask as usize & 255].as_ptr();
        let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(order.cast()));
        let packed = _mm256_permutevar8x32_epi32(keys_of(near), order);
        (mask.count_ones() as usize, packed)
    }
}
