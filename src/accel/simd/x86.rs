//! Hand-written AVX2 and AVX-512 tests, and the doors to code compiled with them.
//!
//! The traits' methods are inlined into the functions at the end, which carry the target features;
//! those are only called after the machine was asked.
#![expect(unsafe_code, reason = "intrinsics; every block says why it is sound")]

use std::arch::x86_64::*;

use super::super::block::{BLOCK_SIZE, Block, BlockRadii};
use super::super::node::{Node, WIDTH};
use super::{BlockCrossings, Kernel, KernelTask, SLAB_SLACK, SimdLevel, Supported, finite_inverse};
use crate::ray::Ray;

pub(super) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("bmi1")
}

pub(super) fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

/// What the slab test needs of a ray: one lane per axis, the fourth unused.
#[derive(Clone, Copy)]
struct SlabRay {
    origin: __m128,
    inverse: __m128,
    /// Distance that the padding of boxes adds on either side, per axis.
    reach: __m128,
    /// Which side's planes come first, per axis: 1 where the direction is negative.
    near_side: [usize; 3],
    t_min: f32,
}

/// Step, base and slack of a node's planes as distances along the ray, per axis.
struct SlabNode {
    step: __m128,
    base: __m128,
    slack: __m128,
}

impl SlabRay {
    #[inline(always)]
    fn new(ray: &Ray, padding: f32) -> Self {
        let inverse = finite_inverse(ray.direction);
        let reach = inverse.abs() * padding;
        // SAFETY: SSE2 is part of x86-64.
        unsafe {
            Self {
                origin: _mm_setr_ps(ray.origin.x, ray.origin.y, ray.origin.z, 0.0),
                inverse: _mm_setr_ps(inverse.x, inverse.y, inverse.z, 1.0),
                reach: _mm_setr_ps(reach.x, reach.y, reach.z, 0.0),
                near_side: inverse
                    .to_array()
                    .map(|d| usize::from(d.is_sign_negative())),
                t_min: ray.t_min.max(0.0),
            }
        }
    }

    #[inline(always)]
    fn enter(&self, node: &Node) -> SlabNode {
        // SAFETY: SSE4.1 and FMA are there, or no kernel here would run. The 16 bytes read from the
        // node's start are its origin, exponents and mask: within its 64 bytes.
        unsafe {
            let head = _mm_load_si128(std::ptr::from_ref(node).cast());
            // The fourth lane is kept at zero throughout: what else it would hold gives denormal
            // products, each of which costs an Intel processor over a hundred cycles.
            let origin = _mm_blend_ps::<0b1000>(_mm_castsi128_ps(head), self.origin);
            let three = _mm_setr_epi32(0, 0, 0, 0x00ff_ffff);
            let exponents = _mm_cvtepu8_epi32(_mm_srli_si128::<12>(_mm_and_si128(head, three)));
            let scale = _mm_castsi128_ps(_mm_slli_epi32::<23>(exponents));
            let step = _mm_mul_ps(scale, self.inverse);
            let base = _mm_mul_ps(_mm_sub_ps(origin, self.origin), self.inverse);
            // The part that does not wait for the origin comes first.
            let fixed = _mm_fmadd_ps(absolute(step), _mm_set1_ps(255.0 * SLAB_SLACK), self.reach);
            let slack = _mm_fmadd_ps(absolute(base), _mm_set1_ps(SLAB_SLACK), fixed);
            SlabNode { step, base, slack }
        }
    }

    /// Where the ray enters and leaves each child of `node`, within its own start and `limit`.
    ///
    /// # Safety
    /// The caller's machine has AVX2 and FMA.
    #[inline(always)]
    unsafe fn test(&self, node: &Node, limit: f32) -> (__m256, __m256) {
        // SAFETY: AVX2 and FMA by contract. Plane loads are of eight bytes out of arrays of eight.
        unsafe {
            let slab = self.enter(node);
            let low = _mm_sub_ps(slab.base, slab.slack);
            let high = _mm_add_ps(slab.base, slab.slack);
            let mut near = _mm256_set1_ps(self.t_min);
            let mut far = _mm256_set1_ps(limit);
            macro_rules! axis {
                ($axis:literal, $lanes:literal) => {
                    let side = self.near_side[$axis];
                    let step = spread::<$lanes>(slab.step);
                    let enter = planes(&node.planes[$axis][side]);
                    let leave = planes(&node.planes[$axis][1 - side]);
                    let enter = _mm256_fmadd_ps(enter, step, spread::<$lanes>(low));
                    let leave = _mm256_fmadd_ps(leave, step, spread::<$lanes>(high));
                    // A NaN (planes beyond the range of f32) yields the second operand: no bound.
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

/// # Safety
/// None beyond x86-64; unsafe as intrinsics outside a target feature are.
#[inline(always)]
unsafe fn absolute(v: __m128) -> __m128 {
    // SAFETY: SSE2 is part of x86-64.
    unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), v) }
}

/// 256-bit kernel.
#[derive(Debug, Clone, Copy)]
struct Avx2;

struct Avx2Ray {
    ray: Ray,
    slab: SlabRay,
    radius_squared: f32,
}

impl Avx2Ray {
    /// Middle of the chord and discriminant for lanes `half * 8 .. half * 8 + 8`.
    ///
    /// # Safety
    /// The caller's machine has AVX2 and FMA.
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
            let cx = _mm256_sub_ps(load(&block.x), _mm256_set1_ps(o.x));
            let cy = _mm256_sub_ps(load(&block.y), _mm256_set1_ps(o.y));
            let cz = _mm256_sub_ps(load(&block.z), _mm256_set1_ps(o.z));
            let (dx, dy, dz) = (
                _mm256_set1_ps(d.x),
                _mm256_set1_ps(d.y),
                _mm256_set1_ps(d.z),
            );
            let middle = _mm256_fmadd_ps(cz, dz, _mm256_fmadd_ps(cy, dy, _mm256_mul_ps(cx, dx)));
            let ax = _mm256_fnmadd_ps(middle, dx, cx);
            let ay = _mm256_fnmadd_ps(middle, dy, cy);
            let az = _mm256_fnmadd_ps(middle, dz, cz);
            let across = _mm256_fmadd_ps(az, az, _mm256_fmadd_ps(ay, ay, _mm256_mul_ps(ax, ax)));
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

    /// The crossing that counts, and the lanes where it lies in `t_min..=limit`.
    ///
    /// # Safety
    /// The caller's machine has AVX2 and FMA.
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
            let t_min = _mm256_set1_ps(self.ray.t_min);
            let near = _mm256_sub_ps(middle, chord);
            let far = _mm256_add_ps(middle, chord);
            let ahead = _mm256_cmp_ps::<_CMP_GE_OQ>(near, t_min);
            let t = _mm256_blendv_ps(far, near, ahead);
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
    fn prepare(self, ray: &Ray, radius: f32, padding: f32) -> Avx2Ray {
        Avx2Ray {
            ray: *ray,
            slab: SlabRay::new(ray, padding),
            radius_squared: radius * radius,
        }
    }

    #[inline(always)]
    fn test_node(self, ray: &Avx2Ray, node: &Node, limit: f32) -> (usize, __m256i) {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            let (near, far) = ray.slab.test(node, limit);
            let entered = _mm256_cmp_ps::<_CMP_LE_OQ>(near, far);
            let mask = _mm256_movemask_ps(entered).cast_unsigned() & u32::from(node.child_mask);
            let order = COMPRESSED[mask as usize & 255].as_ptr();
            let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(order.cast()));
            let packed = _mm256_permutevar8x32_epi32(keys_of(near), order);
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
        ray: &Avx2Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)> {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            let (t_low, lanes_low) = ray.distances(block, radii, 0, limit);
            let (t_high, lanes_high) = ray.distances(block, radii, 1, limit);
            let mut lanes = lanes_low | (lanes_high << 8);
            if lanes == 0 {
                return None;
            }
            let mut t = [0.0_f32; BLOCK_SIZE];
            _mm256_storeu_ps(t.as_mut_ptr(), t_low);
            _mm256_storeu_ps(t.as_mut_ptr().add(8), t_high);
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
    fn prefetch_node(self, node: &Node) {
        prefetch_line(node, 0);
    }

    #[inline(always)]
    fn prefetch_block(self, block: &Block) {
        (0..3).for_each(|line| prefetch_line(block, line));
    }
}

/// Keys of eight distances: see [`Kernel::Keys`].
///
/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
unsafe fn keys_of(distances: __m256) -> __m256i {
    // SAFETY: AVX2 by contract.
    unsafe {
        let slots = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let bits = _mm256_and_si256(_mm256_castps_si256(distances), _mm256_set1_epi32(!7));
        _mm256_or_si256(bits, slots)
    }
}

/// All lanes.
#[inline(always)]
fn keys_to_array(keys: __m256i) -> [u32; WIDTH] {
    let mut array = [0; WIDTH];
    // SAFETY: AVX is there, or no kernel here would run; the store fills the array.
    unsafe { _mm256_storeu_si256(array.as_mut_ptr().cast(), keys) };
    array
}

/// The first two lanes, by register.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the two halves")]
fn first_two(keys: __m256i) -> [u32; 2] {
    // SAFETY: SSE2 is part of x86-64.
    let pair = unsafe { _mm_cvtsi128_si64(_mm256_castsi256_si128(keys)) }.cast_unsigned();
    [pair as u32, (pair >> 32) as u32]
}

/// For each mask of eight lanes, the lanes that are set, in order: AVX2 has no compress.
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

/// Eight planes as floats.
///
/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
unsafe fn planes(bytes: &[u8; WIDTH]) -> __m256 {
    // SAFETY: eight bytes are read from an array of eight; AVX2 by contract.
    unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(bytes.as_ptr().cast()))) }
}

/// One lane (chosen by `SHUFFLE`) in all eight.
///
/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
unsafe fn spread<const SHUFFLE: i32>(v: __m128) -> __m256 {
    // SAFETY: AVX2 by contract.
    unsafe {
        let lane = _mm_shuffle_ps::<SHUFFLE>(v, v);
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(lane), lane)
    }
}

#[inline(always)]
fn prefetch_line<T>(value: &T, line: usize) {
    // SAFETY: a prefetch never faults, whatever the address; the cast keeps within or just past
    // `value`, by wrapping arithmetic.
    unsafe {
        let address = std::ptr::from_ref(value)
            .cast::<i8>()
            .wrapping_add(64 * line);
        _mm_prefetch::<_MM_HINT_T0>(address);
    }
}

/// 512-bit kernel.
#[derive(Debug, Clone, Copy)]
struct Avx512;

struct Avx512Ray {
    ray: Ray,
    slab: SlabRay,
    radius_squared: f32,
}

impl Avx512Ray {
    /// Middle of the chord and discriminant of all lanes.
    ///
    /// # Safety
    /// The caller's machine has AVX-512 F.
    #[inline(always)]
    unsafe fn chords(&self, block: &Block, radii: Option<&BlockRadii>) -> (__m512, __m512) {
        let o = self.ray.origin;
        let d = self.ray.direction;
        // SAFETY: AVX-512 by contract; the loads are of arrays of 16 aligned to 64 bytes.
        unsafe {
            let cx = _mm512_sub_ps(_mm512_load_ps(block.x.as_ptr()), _mm512_set1_ps(o.x));
            let cy = _mm512_sub_ps(_mm512_load_ps(block.y.as_ptr()), _mm512_set1_ps(o.y));
            let cz = _mm512_sub_ps(_mm512_load_ps(block.z.as_ptr()), _mm512_set1_ps(o.z));
            let (dx, dy, dz) = (
                _mm512_set1_ps(d.x),
                _mm512_set1_ps(d.y),
                _mm512_set1_ps(d.z),
            );
            let middle = _mm512_fmadd_ps(cz, dz, _mm512_fmadd_ps(cy, dy, _mm512_mul_ps(cx, dx)));
            let ax = _mm512_fnmadd_ps(middle, dx, cx);
            let ay = _mm512_fnmadd_ps(middle, dy, cy);
            let az = _mm512_fnmadd_ps(middle, dz, cz);
            let across = _mm512_fmadd_ps(az, az, _mm512_fmadd_ps(ay, ay, _mm512_mul_ps(ax, ax)));
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

    /// The crossing that counts, and the lanes where it lies in `t_min..=limit`.
    ///
    /// # Safety
    /// The caller's machine has AVX-512 F.
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
            let t_min = _mm512_set1_ps(self.ray.t_min);
            let near = _mm512_sub_ps(middle, chord);
            let far = _mm512_add_ps(middle, chord);
            let ahead = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(near, t_min);
            let t = _mm512_mask_blend_ps(ahead, far, near);
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
    fn prepare(self, ray: &Ray, radius: f32, padding: f32) -> Avx512Ray {
        Avx512Ray {
            ray: *ray,
            slab: SlabRay::new(ray, padding),
            radius_squared: radius * radius,
        }
    }

    /// In 256 bits as for AVX2: a node has eight children, and the 512-bit form (both sides of an axis
    /// in one register) has the longer chain from load to branch.
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
    fn prefetch_node(self, node: &Node) {
        prefetch_line(node, 0);
    }

    #[inline(always)]
    fn prefetch_block(self, block: &Block) {
        (0..3).for_each(|line| prefetch_line(block, line));
    }
}

/// A task compiled with a kernel's instructions.
macro_rules! compiled {
    ($run:ident, $kernel:expr, $level:path, $features:literal) => {
        /// # Panics
        /// If `proof` is of another level.
        pub(super) fn $run<T: KernelTask>(proof: Supported, task: T) -> T::Output {
            #[target_feature(enable = $features)]
            fn with_features<T: KernelTask>(task: T) -> T::Output {
                task.run($kernel)
            }
            assert_eq!(proof.level(), $level);
            // SAFETY: a `Supported` is only made for a level whose features the machine was found
            // to have, and this one is for the level of these features.
            unsafe { with_features(task) }
        }
    };
}

compiled!(run_avx2, Avx2, SimdLevel::Avx2, "avx2,fma,popcnt,bmi1");
compiled!(
    run_avx512,
    Avx512,
    SimdLevel::Avx512,
    "avx2,fma,popcnt,bmi1,avx512f,avx512bw,avx512dq,avx512vl"
);
