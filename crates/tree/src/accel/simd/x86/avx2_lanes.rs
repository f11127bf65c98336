//! Tests the children of a node with each ray of a packet, eight rays at a time.

use std::arch::x86_64::*;

use super::super::SLAB_SLACK;
use super::super::packet::{EnteredChildren, LaneSlabs, key_of};
use super::lanes::ChildBoxes;
use crate::blocks::{Node, WIDTH};
use crate::ray::PACKET_SIZE;

/// Lanes per register.
const LANES: usize = 8;

/// Where eight rays intersect the planes of a node along one axis: at `step * plane + base`, within `slack`.
#[derive(Clone, Copy)]
struct AxisSlabs {
    step: __m256,
    base: __m256,
    slack: __m256,
}

/// # Safety
/// The caller's machine has AVX2.
#[inline(always)]
unsafe fn absolute(v: __m256) -> __m256 {
    // SAFETY: AVX2 by contract.
    unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), v) }
}

/// Lanes `first .. first + 8` of `values`.
///
/// # Safety
/// The machine of the caller has AVX2, and `first` is 0 or 8.
#[inline(always)]
unsafe fn load(values: &[f32; PACKET_SIZE], first: usize) -> __m256 {
    // SAFETY: AVX2 by contract; lanes 0..8 or 8..16 of 16 are read.
    unsafe { _mm256_loadu_ps(values.as_ptr().add(first)) }
}

/// Expands the low eight bits of `lanes` to a mask of eight lanes.
///
/// # Safety
/// The machine of the caller has AVX2.
#[inline(always)]
unsafe fn lane_mask(lanes: u32) -> __m256 {
    // SAFETY: AVX2 by contract.
    unsafe {
        let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let set = _mm256_and_si256(_mm256_set1_epi32(lanes.cast_signed()), bits);
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, bits))
    }
}

/// Minimum of eight lanes, none of which is NaN.
///
/// # Safety
/// The machine of the caller has AVX2.
#[inline(always)]
unsafe fn least(v: __m256) -> f32 {
    // SAFETY: AVX2 by contract.
    unsafe {
        let four = _mm_min_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
        let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32(_mm_min_ss(two, _mm_movehdup_ps(two)))
    }
}

impl AxisSlabs {
    /// # Safety
    /// The caller's machine has AVX2 and FMA, and `first` is 0 or 8.
    #[inline(always)]
    unsafe fn new(rays: &LaneSlabs, first: usize, node: &Node, axis: usize) -> Self {
        let scale = f32::from_bits(u32::from(node.exponent[axis]) << 23);
        // SAFETY: AVX2 and FMA by contract, and so is `first`.
        unsafe {
            let inverse = load(&rays.inverse[axis], first);
            let origin = load(&rays.origin[axis], first);
            // Convert the grid of the node to distances along the rays, with slack
            let step = _mm256_mul_ps(_mm256_set1_ps(scale), inverse);
            let to_node = _mm256_sub_ps(_mm256_set1_ps(node.origin[axis]), origin);
            let base = _mm256_mul_ps(to_node, inverse);
            let terms = _mm256_fmadd_ps(absolute(step), _mm256_set1_ps(255.0), absolute(base));
            let reach = load(&rays.reach[axis], first);
            let slack = _mm256_fmadd_ps(terms, _mm256_set1_ps(SLAB_SLACK), reach);
            Self { step, base, slack }
        }
    }
}

/// The lanes of `first .. first + 8` that enter each child, as the low eight bits. Writes the entry distances to
/// `near_of`.
///
/// # Safety
/// The machine of the caller has AVX2 and FMA, and `first` is 0 or 8.
#[inline(always)]
unsafe fn test_half(
    rays: &LaneSlabs,
    first: usize,
    (node, boxes): (&Node, &ChildBoxes),
    alive: u32,
    limits: &[f32; PACKET_SIZE],
    near_of: &mut [[f32; PACKET_SIZE]; WIDTH],
) -> [u32; WIDTH] {
    let mut lanes_of = [0; WIDTH];
    // SAFETY: AVX2 and FMA by contract, and so is `first`; stores are of lanes 0..8 or 8..16 of 16.
    unsafe {
        let slabs = [
            AxisSlabs::new(rays, first, node, 0),
            AxisSlabs::new(rays, first, node, 1),
            AxisSlabs::new(rays, first, node, 2),
        ];
        let start = load(&rays.t_min, first);
        let limit = load(limits, first);
        let alive = lane_mask(alive);
        let never = _mm256_set1_ps(f32::INFINITY);
        for slot in 0..node.child_count() {
            // Clip all rays to the box of the child
            let (mut near, mut far) = (start, limit);
            for (axis, slab) in slabs.iter().enumerate() {
                let AxisSlabs { step, base, slack } = *slab;
                let middle = _mm256_set1_ps(boxes.middle[axis][slot]);
                let half = _mm256_set1_ps(boxes.half[axis][slot]);
                let at = _mm256_fmadd_ps(middle, step, base);
                let extent = _mm256_fmadd_ps(half, absolute(step), slack);
                // If the first operand is NaN, the result is the second one: no bound.
                near = _mm256_max_ps(_mm256_sub_ps(at, extent), near);
                far = _mm256_min_ps(_mm256_add_ps(at, extent), far);
            }
            // Store the entry distances, and the lanes that enter the child
            let entered = _mm256_and_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far), alive);
            let near = _mm256_blendv_ps(never, near, entered);
            _mm256_storeu_ps(near_of[slot].as_mut_ptr().add(first), near);
            lanes_of[slot] = _mm256_movemask_ps(entered).cast_unsigned();
        }
    }
    lanes_of
}

/// [`PacketKernel::test_node_with_lanes`].
///
/// # Safety
/// The caller's machine has AVX2 and FMA.
///
/// [`PacketKernel::test_node_with_lanes`]: super::super::PacketKernel::test_node_with_lanes
#[inline(always)]
pub(super) unsafe fn test_node(
    rays: &LaneSlabs,
    node: &Node,
    alive: u32,
    limits: &[f32; PACKET_SIZE],
    entered: &mut EnteredChildren,
) -> usize {
    // SAFETY: AVX2 and FMA by contract; lanes start at 0 and 8.
    unsafe {
        // Test both halves of the packet
        let boxes = ChildBoxes::of(node);
        let child = (node, &boxes);
        let low = test_half(rays, 0, child, alive, limits, &mut entered.near);
        let high = test_half(rays, LANES, child, alive >> LANES, limits, &mut entered.near);
        // Make the keys of the entered children from the least entry distances
        let mut found = 0;
        for slot in 0..node.child_count() {
            if low[slot] | high[slot] == 0 {
                continue;
            }
            let near = &entered.near[slot];
            let first = _mm256_min_ps(load(near, 0), load(near, LANES));
            entered.keys[found] = key_of(least(first), slot);
            found += 1;
        }
        found
    }
}

/// [`PacketKernel::lanes_within`].
///
/// # Safety
/// The caller's machine has AVX2.
///
/// [`PacketKernel::lanes_within`]: super::super::PacketKernel::lanes_within
#[inline(always)]
pub(super) unsafe fn within(near: &[f32; PACKET_SIZE], limits: &[f32; PACKET_SIZE]) -> u32 {
    // SAFETY: AVX2 by contract; lanes start at 0 and 8.
    unsafe {
        let low = _mm256_cmp_ps::<_CMP_LE_OQ>(load(near, 0), load(limits, 0));
        let high = _mm256_cmp_ps::<_CMP_LE_OQ>(load(near, LANES), load(limits, LANES));
        let bits = |mask: __m256| _mm256_movemask_ps(mask).cast_unsigned();
        bits(low) | bits(high) << LANES
    }
}
