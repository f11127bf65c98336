//! NEON intrinsics for 64-bit Arm, where NEON is always available.
//!
//! The operations and their order are those of the x86 kernels, so pictures agree to the bit. Eight children are two
//! registers of four lanes, a block is four registers. Without an Arm machine, `cargo test --target
//! aarch64-unknown-linux-gnu --lib accel` under `qemu-aarch64` runs all of it. Its speed has not been measured.
#![expect(unsafe_code, reason = "intrinsics; every block says why it is sound")]

use std::arch::aarch64::*;
use std::arch::asm;

use glam::Vec3;

use super::loop_packet::LoopPackets;
use super::{BlockCrossings, Kernel, LINE, SLAB_SLACK};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii};
use crate::blocks::{Node, WIDTH};
use crate::ray::Ray;

/// Lanes per register.
const LANES: usize = 4;

/// The 128-bit kernel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neon;

/// A prepared ray; the slab vectors have one lane per axis, and a fourth lane of zero.
pub(super) struct NeonRay {
    ray: Ray,
    radius_squared: f32,
    origin: float32x4_t,
    inverse: float32x4_t,
    /// Distance along the ray that the padding of boxes adds on either side, per axis.
    reach: float32x4_t,
    /// Index of the near planes per axis: 1 if the direction is negative.
    near_side: [usize; 3],
}

impl NeonRay {
    fn new(ray: &Ray, inverse: Vec3, radius: f32, padding: f32) -> Self {
        let reach = inverse.abs() * padding;
        Self {
            ray: *ray,
            radius_squared: radius * radius,
            origin: load(&[ray.origin.x, ray.origin.y, ray.origin.z, 0.0], 0),
            inverse: load(&[inverse.x, inverse.y, inverse.z, 0.0], 0),
            reach: load(&[reach.x, reach.y, reach.z, 0.0], 0),
            near_side: inverse.to_array().map(|d| usize::from(d.is_sign_negative())),
        }
    }

    /// Where the ray enters and leaves each child of `node`, between its `t_min` and `limit`.
    #[inline(always)]
    fn slabs(&self, node: &Node, limit: f32) -> ([float32x4_t; 2], [float32x4_t; 2]) {
        let [x, y, z] = node.origin;
        let scale = node.exponent.map(|e| f32::from_bits(u32::from(e) << 23));
        let corner = load(&[x, y, z, 0.0], 0);
        let scale = load(&[scale[0], scale[1], scale[2], 0.0], 0);
        // SAFETY: NEON is part of every 64-bit Arm target of Rust's with floats.
        unsafe {
            // Convert the grid of the node to distances along the ray, with slack
            let step = vmulq_f32(scale, self.inverse);
            let base = vmulq_f32(vsubq_f32(corner, self.origin), self.inverse);
            let fixed = vfmaq_f32(self.reach, vabsq_f32(step), vdupq_n_f32(255.0 * SLAB_SLACK));
            let slack = vfmaq_f32(fixed, vabsq_f32(base), vdupq_n_f32(SLAB_SLACK));
            let low = vsubq_f32(base, slack);
            let high = vaddq_f32(base, slack);
            // Clip the ray to the slabs of all children, axis by axis
            let mut near = [vdupq_n_f32(self.ray.t_min.max(0.0)); 2];
            let mut far = [vdupq_n_f32(limit); 2];
            macro_rules! axis {
                ($axis:literal) => {
                    let side = self.near_side[$axis];
                    let step = vdupq_laneq_f32::<$axis>(step);
                    let enter = planes(&node.planes[$axis][side]);
                    let leave = planes(&node.planes[$axis][1 - side]);
                    for half in 0..2 {
                        let enter = vfmaq_f32(vdupq_laneq_f32::<$axis>(low), enter[half], step);
                        let leave = vfmaq_f32(vdupq_laneq_f32::<$axis>(high), leave[half], step);
                        // If one operand is NaN (planes beyond the range of f32), these return the other one: no bound.
                        near[half] = vmaxnmq_f32(enter, near[half]);
                        far[half] = vminnmq_f32(leave, far[half]);
                    }
                };
            }
            axis!(0);
            axis!(1);
            axis!(2);
            (near, far)
        }
    }

    /// Midpoint of the chord and discriminant for lanes `first .. first + 4` of a block.
    #[inline(always)]
    fn chords(
        &self,
        block: &Block,
        radii: Option<&BlockRadii>,
        first: usize,
    ) -> (float32x4_t, float32x4_t) {
        let (o, d) = (self.ray.origin, self.ray.direction);
        let (x, y, z) = (load(&block.x, first), load(&block.y, first), load(&block.z, first));
        // SAFETY: NEON is part of every 64-bit Arm target of Rust's with floats.
        unsafe {
            // Find the points of the ray nearest to the centres, and the vectors between them
            let cx = vsubq_f32(x, vdupq_n_f32(o.x));
            let cy = vsubq_f32(y, vdupq_n_f32(o.y));
            let cz = vsubq_f32(z, vdupq_n_f32(o.z));
            let (dx, dy, dz) = (vdupq_n_f32(d.x), vdupq_n_f32(d.y), vdupq_n_f32(d.z));
            let middle = vfmaq_f32(vfmaq_f32(vmulq_f32(cx, dx), cy, dy), cz, dz);
            let ax = vfmsq_f32(cx, middle, dx);
            let ay = vfmsq_f32(cy, middle, dy);
            let az = vfmsq_f32(cz, middle, dz);
            let across = vfmaq_f32(vfmaq_f32(vmulq_f32(ax, ax), ay, ay), az, az);
            // Subtract the squared distances from the squared radii
            let squared = match radii {
                Some(radii) => {
                    let r = load(&radii.0, first);
                    vmulq_f32(r, r)
                }
                None => vdupq_n_f32(self.radius_squared),
            };
            (middle, vsubq_f32(squared, across))
        }
    }

    /// The hit distance of each of the four lanes, and a mask of those in `t_min..=limit`.
    #[inline(always)]
    fn distances(
        &self,
        block: &Block,
        radii: Option<&BlockRadii>,
        first: usize,
        limit: f32,
    ) -> ([f32; LANES], u32) {
        let (middle, discriminant) = self.chords(block, radii, first);
        // SAFETY: NEON is part of every 64-bit Arm target of Rust's with floats.
        unsafe {
            let hit = vcgezq_f32(discriminant);
            if vmaxvq_u32(hit) == 0 {
                return ([0.0; LANES], 0);
            }
            // Choose the first intersection that does not lie before `t_min`
            let chord = vsqrtq_f32(vmaxnmq_f32(discriminant, vdupq_n_f32(0.0)));
            let t_min = vdupq_n_f32(self.ray.t_min);
            let near = vsubq_f32(middle, chord);
            let far = vaddq_f32(middle, chord);
            let t = vbslq_f32(vcgeq_f32(near, t_min), near, far);
            let inside = vandq_u32(vcgeq_f32(t, t_min), vcleq_f32(t, vdupq_n_f32(limit)));
            (store(t), bits(vandq_u32(hit, inside)))
        }
    }
}

impl LoopPackets for Neon {
    const FUSED: bool = true;
}

impl Kernel for Neon {
    type Ray = NeonRay;
    type Keys = [u32; WIDTH];

    #[inline(always)]
    fn prepare(self, ray: &Ray, inverse: Vec3, radius: f32, padding: f32) -> NeonRay {
        NeonRay::new(ray, inverse, radius, padding)
    }

    #[inline(always)]
    fn test_node(self, ray: &NeonRay, node: &Node, limit: f32) -> (usize, [u32; WIDTH]) {
        let (near, far) = ray.slabs(node, limit);
        // SAFETY: NEON is part of every 64-bit Arm target of Rust's with floats.
        let entered = unsafe {
            bits(vcleq_f32(near[0], far[0])) | (bits(vcleq_f32(near[1], far[1])) << LANES)
        };
        // Compress the keys of the entered children
        let mut mask = entered & u32::from(node.child_mask);
        let distances = [store(near[0]), store(near[1])];
        let mut keys = [0; WIDTH];
        let mut found = 0;
        while mask != 0 {
            let slot = mask.trailing_zeros();
            mask &= mask - 1;
            let t = distances[slot as usize / LANES][slot as usize % LANES];
            keys[found] = (t.to_bits() & !7) | slot;
            found += 1;
        }
        (found, keys)
    }

    #[inline(always)]
    fn first_two(self, keys: [u32; WIDTH]) -> [u32; 2] {
        [keys[0], keys[1]]
    }

    #[inline(always)]
    fn all_keys(self, keys: [u32; WIDTH]) -> [u32; WIDTH] {
        keys
    }

    #[inline(always)]
    fn nearest_in_block(
        self,
        ray: &NeonRay,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)> {
        let (mut best, mut tied) = (limit, 0);
        for first in (0..BLOCK_SIZE).step_by(LANES) {
            let (t, mut lanes) = ray.distances(block, radii, first, best);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                // Keep the nearest distance and all lanes with it
                let distance = t[lane % LANES];
                if distance <= best {
                    tied = if distance < best { 0 } else { tied } | (1 << (first + lane));
                    best = distance;
                }
            }
        }
        (tied != 0).then_some((best, tied))
    }

    #[inline(always)]
    fn any_in_block(
        self,
        ray: &NeonRay,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> bool {
        (0..BLOCK_SIZE).step_by(LANES).any(|first| ray.distances(block, radii, first, limit).1 != 0)
    }

    #[inline(always)]
    fn all_in_block(
        self,
        ray: &NeonRay,
        block: &Block,
        radii: Option<&BlockRadii>,
    ) -> BlockCrossings {
        let mut found = BlockCrossings::NONE;
        for first in (0..BLOCK_SIZE).step_by(LANES) {
            let (middle, discriminant) = ray.chords(block, radii, first);
            // SAFETY: NEON is part of every 64-bit Arm target of Rust's with floats.
            let (lanes, near, far) = unsafe {
                let chord = vsqrtq_f32(vmaxnmq_f32(discriminant, vdupq_n_f32(0.0)));
                (bits(vcgezq_f32(discriminant)), vsubq_f32(middle, chord), vaddq_f32(middle, chord))
            };
            found.lanes |= lanes << first;
            found.near[first..first + LANES].copy_from_slice(&store(near));
            found.far[first..first + LANES].copy_from_slice(&store(far));
        }
        found
    }

    #[inline(always)]
    fn prefetch<T>(self, value: &T) {
        (0..size_of::<T>().div_ceil(LINE)).for_each(|line| prefetch_line(value, line));
    }
}

/// Loads four elements of `values` from `first` on.
#[inline(always)]
fn load<const N: usize>(values: &[f32; N], first: usize) -> float32x4_t {
    let four = &values[first..first + LANES];
    // SAFETY: NEON is there; `four` has the four numbers that are read.
    unsafe { vld1q_f32(four.as_ptr()) }
}

#[inline(always)]
fn store(v: float32x4_t) -> [f32; LANES] {
    let mut array = [0.0; LANES];
    // SAFETY: NEON is there; the store fills the array.
    unsafe { vst1q_f32(array.as_mut_ptr(), v) };
    array
}

/// One bit per lane of the result of a comparison.
#[inline(always)]
fn bits(mask: uint32x4_t) -> u32 {
    const BITS: [u32; LANES] = [1, 2, 4, 8];
    // SAFETY: NEON is there; the load reads the array's four numbers.
    unsafe { vaddvq_u32(vandq_u32(mask, vld1q_u32(BITS.as_ptr()))) }
}

/// Eight planes as floats.
#[inline(always)]
fn planes(bytes: &[u8; WIDTH]) -> [float32x4_t; 2] {
    // SAFETY: NEON is there; eight bytes are read from an array of eight.
    unsafe {
        let wide = vmovl_u8(vld1_u8(bytes.as_ptr()));
        [vcvtq_f32_u32(vmovl_u16(vget_low_u16(wide))), vcvtq_f32_u32(vmovl_high_u16(wide))]
    }
}

#[inline(always)]
fn prefetch_line<T>(value: &T, line: usize) {
    let address = std::ptr::from_ref(value).cast::<u8>().wrapping_add(LINE * line);
    // SAFETY: a prefetch never faults, whatever the address, and changes nothing that Rust sees.
    unsafe {
        asm!("prfm pldl1keep, [{0}]", in(reg) address, options(nostack, preserves_flags, readonly));
    }
}
