//! Packet tests of the 512-bit kernel: one register holds one value per ray.

use std::arch::x86_64::*;

use super::super::super::hits::TreeHits;
use super::super::packet::{EnteredChildren, LaneSlabs, key_of};
use super::super::{Beam, PacketKernel, PacketSphere, SLAB_SLACK};
use super::avx512::Avx512;
use super::beam;
use super::lanes::{ChildBoxes, keys_of};
use crate::blocks::{Block, BlockRadii, Node};
use crate::ray::{PACKET_SIZE, RayPacket};

/// The hit distance of each ray with `sphere`, and the lanes with a distance in `t_min..=limit`. The operations for
/// each pair of ray and sphere are those of the test for single rays.
///
/// # Safety
/// The machine of the caller has AVX-512 F.
#[inline(always)]
unsafe fn distances(
    packet: &RayPacket,
    sphere: &PacketSphere,
    hits: &TreeHits,
) -> (__m512, __mmask16) {
    let load = |lanes: &[f32; 16]| {
        // SAFETY: AVX-512 by contract; 16 values are read from an array of 16.
        unsafe { _mm512_loadu_ps(lanes.as_ptr()) }
    };
    // SAFETY: AVX-512 by contract.
    unsafe {
        // Find the points of the rays nearest to the centre, and the vectors between them
        let [x, y, z] = sphere.center;
        let cx = _mm512_sub_ps(_mm512_set1_ps(x), load(&packet.origin[0]));
        let cy = _mm512_sub_ps(_mm512_set1_ps(y), load(&packet.origin[1]));
        let cz = _mm512_sub_ps(_mm512_set1_ps(z), load(&packet.origin[2]));
        let dx = load(&packet.direction[0]);
        let dy = load(&packet.direction[1]);
        let dz = load(&packet.direction[2]);
        let middle = _mm512_fmadd_ps(cz, dz, _mm512_fmadd_ps(cy, dy, _mm512_mul_ps(cx, dx)));
        let ax = _mm512_fnmadd_ps(middle, dx, cx);
        let ay = _mm512_fnmadd_ps(middle, dy, cy);
        let az = _mm512_fnmadd_ps(middle, dz, cz);
        let across = _mm512_fmadd_ps(az, az, _mm512_fmadd_ps(ay, ay, _mm512_mul_ps(ax, ax)));
        // Stop if all rays miss the sphere
        let discriminant = _mm512_sub_ps(_mm512_set1_ps(sphere.radius_squared), across);
        let zero = _mm512_setzero_ps();
        let hit = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(discriminant, zero);
        if hit == 0 {
            return (zero, 0);
        }
        // Choose the first intersection that does not lie before `t_min`
        let chord = _mm512_sqrt_ps(_mm512_max_ps(discriminant, zero));
        let t_min = load(&packet.t_min);
        let near = _mm512_sub_ps(middle, chord);
        let far = _mm512_add_ps(middle, chord);
        let ahead = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(near, t_min);
        let t = _mm512_mask_blend_ps(ahead, far, near);
        // Keep the lanes with a distance in range
        let after = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(hit, t, t_min);
        let before = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(after, t, load(&hits.t));
        (t, before)
    }
}

/// Where 16 rays intersect the planes of a node along one axis: at `step * plane + base`, within `slack`.
#[derive(Clone, Copy)]
struct AxisSlabs {
    step: __m512,
    base: __m512,
    slack: __m512,
}

impl AxisSlabs {
    /// # Safety
    /// The caller's machine has AVX-512 F and DQ.
    #[inline(always)]
    unsafe fn new(rays: &LaneSlabs, node: &Node, axis: usize) -> Self {
        let scale = f32::from_bits(u32::from(node.exponent[axis]) << 23);
        // SAFETY: AVX-512 by contract; the loads are of arrays of 16.
        unsafe {
            let inverse = _mm512_loadu_ps(rays.inverse[axis].as_ptr());
            let origin = _mm512_loadu_ps(rays.origin[axis].as_ptr());
            let reach = _mm512_loadu_ps(rays.reach[axis].as_ptr());
            // Convert the grid of the node to distances along the rays, with slack
            let step = _mm512_mul_ps(_mm512_set1_ps(scale), inverse);
            let to_node = _mm512_sub_ps(_mm512_set1_ps(node.origin[axis]), origin);
            let base = _mm512_mul_ps(to_node, inverse);
            let widest = _mm512_set1_ps(255.0);
            let terms = _mm512_fmadd_ps(_mm512_abs_ps(step), widest, _mm512_abs_ps(base));
            let slack = _mm512_fmadd_ps(terms, _mm512_set1_ps(SLAB_SLACK), reach);
            Self { step, base, slack }
        }
    }
}

/// [`PacketKernel::test_node_with_lanes`].
///
/// # Safety
/// The caller's machine has AVX-512 F, BW, DQ and VL.
#[inline(always)]
unsafe fn test_node_with_lanes(
    rays: &LaneSlabs,
    node: &Node,
    alive: u32,
    limits: &[f32; PACKET_SIZE],
    entered: &mut EnteredChildren,
) -> usize {
    // SAFETY: AVX-512 by contract; loads and stores are of arrays of 16.
    unsafe {
        let boxes = ChildBoxes::of(node);
        let slabs = [
            AxisSlabs::new(rays, node, 0),
            AxisSlabs::new(rays, node, 1),
            AxisSlabs::new(rays, node, 2),
        ];
        let start = _mm512_loadu_ps(rays.t_min.as_ptr());
        let limit = _mm512_loadu_ps(limits.as_ptr());
        let never = _mm512_set1_ps(f32::INFINITY);
        #[expect(clippy::cast_possible_truncation, reason = "16 lanes")]
        let alive = alive as __mmask16;
        let mut found = 0;
        for slot in 0..node.child_count() {
            // Clip all rays to the box of the child
            let (mut near, mut far) = (start, limit);
            for (axis, slab) in slabs.iter().enumerate() {
                let AxisSlabs { step, base, slack } = *slab;
                let middle = _mm512_set1_ps(boxes.middle[axis][slot]);
                let half = _mm512_set1_ps(boxes.half[axis][slot]);
                let at = _mm512_fmadd_ps(middle, step, base);
                let extent = _mm512_fmadd_ps(half, _mm512_abs_ps(step), slack);
                // If the first operand is NaN, the result is the second one: no bound.
                near = _mm512_max_ps(_mm512_sub_ps(at, extent), near);
                far = _mm512_min_ps(_mm512_add_ps(at, extent), far);
            }
            let lanes = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(alive, near, far);
            if lanes == 0 {
                continue;
            }
            // Store the entry distances, and the least one as the key of the child
            let near = _mm512_mask_blend_ps(lanes, never, near);
            _mm512_storeu_ps(entered.near[slot].as_mut_ptr(), near);
            entered.keys[found] = key_of(_mm512_reduce_min_ps(near), slot);
            found += 1;
        }
        found
    }
}

impl PacketKernel for Avx512 {
    #[inline(always)]
    fn test_node_with_lanes(
        self,
        rays: &LaneSlabs,
        node: &Node,
        alive: u32,
        limits: &[f32; PACKET_SIZE],
        entered: &mut EnteredChildren,
    ) -> usize {
        // SAFETY: this kernel is only used inside functions with AVX-512 F, BW, DQ and VL.
        unsafe { test_node_with_lanes(rays, node, alive, limits, entered) }
    }

    #[inline(always)]
    fn lanes_within(self, near: &[f32; PACKET_SIZE], limits: &[f32; PACKET_SIZE]) -> u32 {
        // SAFETY: this kernel is only used inside functions with AVX-512; the loads are of arrays of
        // 16.
        unsafe {
            let near = _mm512_loadu_ps(near.as_ptr());
            let limits = _mm512_loadu_ps(limits.as_ptr());
            u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(near, limits))
        }
    }

    #[inline(always)]
    fn test_node_with_beam(self, beam: &Beam, node: &Node, limit: f32) -> (usize, __m256i) {
        // SAFETY: this kernel is only used inside functions with AVX-512 F, BW, DQ and VL.
        unsafe {
            let (near, far) = beam::test(beam, node, limit);
            let mask = _mm256_mask_cmp_ps_mask::<_CMP_LE_OQ>(node.child_mask, near, far);
            let packed = _mm256_maskz_compress_epi32(mask, keys_of(near));
            (mask.count_ones() as usize, packed)
        }
    }

    #[inline(always)]
    fn spheres_in_beam(
        self,
        beam: &Beam,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> u32 {
        let (o, d) = (beam.center, beam.axis);
        // SAFETY: this kernel is only used inside functions with AVX-512; the loads are of arrays of
        // 16 aligned to 64 bytes.
        unsafe {
            // Compute the positions along the central ray, and the squared distances from it
            let cx = _mm512_sub_ps(_mm512_load_ps(block.x.as_ptr()), _mm512_set1_ps(o.x));
            let cy = _mm512_sub_ps(_mm512_load_ps(block.y.as_ptr()), _mm512_set1_ps(o.y));
            let cz = _mm512_sub_ps(_mm512_load_ps(block.z.as_ptr()), _mm512_set1_ps(o.z));
            let (dx, dy, dz) = (_mm512_set1_ps(d.x), _mm512_set1_ps(d.y), _mm512_set1_ps(d.z));
            let middle = _mm512_fmadd_ps(cz, dz, _mm512_fmadd_ps(cy, dy, _mm512_mul_ps(cx, dx)));
            let ax = _mm512_fnmadd_ps(middle, dx, cx);
            let ay = _mm512_fnmadd_ps(middle, dy, cy);
            let az = _mm512_fnmadd_ps(middle, dz, cz);
            let across = _mm512_fmadd_ps(az, az, _mm512_fmadd_ps(ay, ay, _mm512_mul_ps(ax, ax)));
            // Compute the radius of the cone at each position
            let radius = match radii {
                Some(radii) => _mm512_load_ps(radii.0.as_ptr()),
                None => _mm512_set1_ps(beam.radius),
            };
            let tip = _mm512_add_ps(radius, _mm512_set1_ps(beam.spread));
            let ahead = _mm512_max_ps(_mm512_add_ps(middle, tip), _mm512_setzero_ps());
            let reach = _mm512_fmadd_ps(ahead, _mm512_set1_ps(beam.growth), tip);
            // "Not greater" is true for NaN, so that the tests of the rays decide in that case.
            let inside = _mm512_cmp_ps_mask::<_CMP_NGT_UQ>(across, _mm512_mul_ps(reach, reach));
            let start = _mm512_sub_ps(middle, reach);
            let limit = _mm512_set1_ps(limit);
            u32::from(_mm512_mask_cmp_ps_mask::<_CMP_NGT_UQ>(inside, start, limit))
        }
    }

    #[inline(always)]
    fn nearest_of_packet(
        self,
        packet: &RayPacket,
        sphere: &PacketSphere,
        hits: &mut TreeHits,
    ) -> u32 {
        // SAFETY: this kernel is only used inside functions with AVX-512; loads and stores are of
        // arrays of 16.
        unsafe {
            let (t, lanes) = distances(packet, sphere, hits);
            if lanes == 0 {
                return 0;
            }
            // Find ties with the current hits
            let limit = _mm512_loadu_ps(hits.t.as_ptr());
            let held = _mm512_loadu_si512(hits.slot.as_ptr().cast());
            let none = _mm512_set1_epi32(TreeHits::NO_SLOT.cast_signed());
            let equal = _mm512_mask_cmp_ps_mask::<_CMP_EQ_OQ>(lanes, t, limit);
            let tied = _mm512_mask_cmpneq_epi32_mask(equal, held, none);
            // Store the nearer hits
            let nearer = lanes & !tied;
            let slot = _mm512_set1_epi32(sphere.slot.cast_signed());
            _mm512_mask_storeu_ps(hits.t.as_mut_ptr(), nearer, t);
            _mm512_mask_storeu_epi32(hits.slot.as_mut_ptr().cast(), nearer, slot);
            u32::from(tied)
        }
    }

    #[inline(always)]
    fn any_of_packet(self, packet: &RayPacket, sphere: &PacketSphere, hits: &TreeHits) -> u32 {
        // SAFETY: this kernel is only used inside functions with AVX-512.
        unsafe { u32::from(distances(packet, sphere, hits).1) }
    }
}
