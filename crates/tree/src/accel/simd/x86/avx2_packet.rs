//! Packet tests of the 256-bit kernel: two registers hold one value per ray.

use std::arch::x86_64::*;

use super::super::super::hits::TreeHits;
use super::super::packet::{EnteredChildren, LaneSlabs};
use super::super::{Beam, PacketKernel, PacketSphere};
use super::avx2::{Avx2, packed_keys};
use super::{avx2_lanes, beam};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii, Node};
use crate::ray::{PACKET_SIZE, RayPacket};

/// The hit distance of each ray in lanes `half * 8 .. half * 8 + 8` with `sphere`, and the lanes with a distance in
/// `t_min..=limit`. The operations for each pair of ray and sphere are those of the test for single rays.
///
/// # Safety
/// The machine of the caller has AVX2 and FMA.
#[inline(always)]
unsafe fn distances(
    packet: &RayPacket,
    sphere: &PacketSphere,
    hits: &TreeHits,
    half: usize,
) -> (__m256, __m256) {
    let load = |lanes: &[f32; PACKET_SIZE]| {
        // SAFETY: AVX2 by contract; lanes 0..8 or 8..16 of 16 are read.
        unsafe { _mm256_loadu_ps(lanes.as_ptr().add(half * 8)) }
    };
    // SAFETY: AVX2 and FMA by contract.
    unsafe {
        // Find the points of the rays nearest to the centre, and the vectors between them
        let [x, y, z] = sphere.center;
        let cx = _mm256_sub_ps(_mm256_set1_ps(x), load(&packet.origin[0]));
        let cy = _mm256_sub_ps(_mm256_set1_ps(y), load(&packet.origin[1]));
        let cz = _mm256_sub_ps(_mm256_set1_ps(z), load(&packet.origin[2]));
        let dx = load(&packet.direction[0]);
        let dy = load(&packet.direction[1]);
        let dz = load(&packet.direction[2]);
        let middle = _mm256_fmadd_ps(cz, dz, _mm256_fmadd_ps(cy, dy, _mm256_mul_ps(cx, dx)));
        let ax = _mm256_fnmadd_ps(middle, dx, cx);
        let ay = _mm256_fnmadd_ps(middle, dy, cy);
        let az = _mm256_fnmadd_ps(middle, dz, cz);
        let across = _mm256_fmadd_ps(az, az, _mm256_fmadd_ps(ay, ay, _mm256_mul_ps(ax, ax)));
        // Stop if all rays miss the sphere
        let discriminant = _mm256_sub_ps(_mm256_set1_ps(sphere.radius_squared), across);
        let zero = _mm256_setzero_ps();
        let hit = _mm256_cmp_ps::<_CMP_GE_OQ>(discriminant, zero);
        if _mm256_movemask_ps(hit) == 0 {
            return (zero, zero);
        }
        // Choose the first intersection that does not lie before `t_min`
        let chord = _mm256_sqrt_ps(_mm256_max_ps(discriminant, zero));
        let t_min = load(&packet.t_min);
        let near = _mm256_sub_ps(middle, chord);
        let far = _mm256_add_ps(middle, chord);
        let ahead = _mm256_cmp_ps::<_CMP_GE_OQ>(near, t_min);
        let t = _mm256_blendv_ps(far, near, ahead);
        // Keep the lanes with a distance in range
        let after = _mm256_cmp_ps::<_CMP_GE_OQ>(t, t_min);
        let before = _mm256_cmp_ps::<_CMP_LE_OQ>(t, load(&hits.t));
        (t, _mm256_and_ps(hit, _mm256_and_ps(after, before)))
    }
}

/// The lanes of half a block whose spheres a ray of the beam may hit.
///
/// # Safety
/// The machine of the caller has AVX2 and FMA.
#[inline(always)]
unsafe fn spheres_in_beam(
    beam: &Beam,
    block: &Block,
    radii: Option<&BlockRadii>,
    limit: f32,
    half: usize,
) -> u32 {
    let (o, d) = (beam.center, beam.axis);
    // SAFETY: AVX2 and FMA by contract; the loads are of lanes 0..8 or 8..16 of 16.
    unsafe {
        // Compute the positions along the central ray, and the squared distances from it
        let load = |v: &[f32; BLOCK_SIZE]| _mm256_load_ps(v.as_ptr().add(half * 8));
        let cx = _mm256_sub_ps(load(&block.x), _mm256_set1_ps(o.x));
        let cy = _mm256_sub_ps(load(&block.y), _mm256_set1_ps(o.y));
        let cz = _mm256_sub_ps(load(&block.z), _mm256_set1_ps(o.z));
        let (dx, dy, dz) = (_mm256_set1_ps(d.x), _mm256_set1_ps(d.y), _mm256_set1_ps(d.z));
        let middle = _mm256_fmadd_ps(cz, dz, _mm256_fmadd_ps(cy, dy, _mm256_mul_ps(cx, dx)));
        let ax = _mm256_fnmadd_ps(middle, dx, cx);
        let ay = _mm256_fnmadd_ps(middle, dy, cy);
        let az = _mm256_fnmadd_ps(middle, dz, cz);
        let across = _mm256_fmadd_ps(az, az, _mm256_fmadd_ps(ay, ay, _mm256_mul_ps(ax, ax)));
        // Compute the radius of the cone at each position
        let radius = match radii {
            Some(radii) => load(&radii.0),
            None => _mm256_set1_ps(beam.radius),
        };
        let tip = _mm256_add_ps(radius, _mm256_set1_ps(beam.spread));
        let ahead = _mm256_max_ps(_mm256_add_ps(middle, tip), _mm256_setzero_ps());
        let reach = _mm256_fmadd_ps(ahead, _mm256_set1_ps(beam.growth), tip);
        // "Not greater" is true for NaN, so that the tests of the rays decide in that case.
        let inside = _mm256_cmp_ps::<_CMP_NGT_UQ>(across, _mm256_mul_ps(reach, reach));
        let start = _mm256_sub_ps(middle, reach);
        let before = _mm256_cmp_ps::<_CMP_NGT_UQ>(start, _mm256_set1_ps(limit));
        _mm256_movemask_ps(_mm256_and_ps(inside, before)).cast_unsigned()
    }
}

impl PacketKernel for Avx2 {
    #[inline(always)]
    fn test_node_with_lanes(
        self,
        rays: &LaneSlabs,
        node: &Node,
        alive: u32,
        limits: &[f32; PACKET_SIZE],
        entered: &mut EnteredChildren,
    ) -> usize {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe { avx2_lanes::test_node(rays, node, alive, limits, entered) }
    }

    #[inline(always)]
    fn lanes_within(self, near: &[f32; PACKET_SIZE], limits: &[f32; PACKET_SIZE]) -> u32 {
        // SAFETY: this kernel is only used inside functions with AVX2.
        unsafe { avx2_lanes::within(near, limits) }
    }

    #[inline(always)]
    fn test_node_with_beam(self, beam: &Beam, node: &Node, limit: f32) -> (usize, __m256i) {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            let (near, far) = beam::test(beam, node, limit);
            packed_keys(node, near, far)
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
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            spheres_in_beam(beam, block, radii, limit, 0)
                | spheres_in_beam(beam, block, radii, limit, 1) << 8
        }
    }

    #[inline(always)]
    fn nearest_of_packet(
        self,
        packet: &RayPacket,
        sphere: &PacketSphere,
        hits: &mut TreeHits,
    ) -> u32 {
        let mut tied_lanes = 0;
        for half in 0..2 {
            // SAFETY: this kernel is only used inside functions with AVX2 and FMA; loads and stores
            // are of lanes 0..8 or 8..16 of 16.
            unsafe {
                let (t, lanes) = distances(packet, sphere, hits, half);
                if _mm256_movemask_ps(lanes) == 0 {
                    continue;
                }
                // Find ties with the current hits
                let limit_at = hits.t.as_mut_ptr().add(half * 8);
                let slot_at = hits.slot.as_mut_ptr().add(half * 8).cast::<i32>();
                let limit = _mm256_loadu_ps(limit_at);
                let held = _mm256_loadu_si256(slot_at.cast());
                let none = _mm256_set1_epi32(TreeHits::NO_SLOT.cast_signed());
                let equal = _mm256_and_ps(lanes, _mm256_cmp_ps::<_CMP_EQ_OQ>(t, limit));
                let empty = _mm256_castsi256_ps(_mm256_cmpeq_epi32(held, none));
                let tied = _mm256_andnot_ps(empty, equal);
                // Store the nearer hits
                let nearer = _mm256_castps_si256(_mm256_andnot_ps(tied, lanes));
                let slot = _mm256_set1_epi32(sphere.slot.cast_signed());
                _mm256_maskstore_ps(limit_at, nearer, t);
                _mm256_maskstore_epi32(slot_at, nearer, slot);
                tied_lanes |= _mm256_movemask_ps(tied).cast_unsigned() << (half * 8);
            }
        }
        tied_lanes
    }

    #[inline(always)]
    fn any_of_packet(self, packet: &RayPacket, sphere: &PacketSphere, hits: &TreeHits) -> u32 {
        // SAFETY: this kernel is only used inside functions with AVX2 and FMA.
        unsafe {
            let low = distances(packet, sphere, hits, 0).1;
            let high = distances(packet, sphere, hits, 1).1;
            (_mm256_movemask_ps(low) | _mm256_movemask_ps(high) << 8).cast_unsigned()
        }
    }
}
