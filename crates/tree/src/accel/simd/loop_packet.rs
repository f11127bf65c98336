//! Packet tests as plain loops, for kernels without packet tests in intrinsics.

use super::super::hits::TreeHits;
use super::packet::{EnteredChildren, LaneSlabs, key_of};
use super::{Beam, Kernel, PacketKernel, PacketSphere, SLAB_SLACK};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii};
use crate::blocks::{Node, WIDTH};
use crate::math::{fold, larger, smaller};
use crate::ray::{PACKET_SIZE, RayPacket};

/// A kernel that tests packets in loops over lanes.
pub(super) trait LoopPackets: Kernel<Keys = [u32; WIDTH]> {
    /// Whether the test for single rays uses fused multiply-add; the packet test must use the same operations.
    const FUSED: bool;
}

/// `a * b + c`, rounded once (fused) or twice.
#[inline(always)]
fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// The hit distance of the ray in `lane` with `sphere`, if it is in `t_min..=limit`. The operations are those of the
/// tests for single rays.
#[inline(always)]
fn distance<const FUSED: bool>(
    packet: &RayPacket,
    lane: usize,
    sphere: &PacketSphere,
    limit: f32,
) -> Option<f32> {
    // Find the point of the ray nearest to the centre, and the distance between them
    let [ox, oy, oz] = [0, 1, 2].map(|axis| sphere.center[axis] - packet.origin[axis][lane]);
    let [dx, dy, dz] = [0, 1, 2].map(|axis| packet.direction[axis][lane]);
    let dot = |a: [f32; 3], b: [f32; 3]| {
        let xy = multiply_add::<FUSED>(a[1], b[1], a[0] * b[0]);
        multiply_add::<FUSED>(a[2], b[2], xy)
    };
    let middle = dot([ox, oy, oz], [dx, dy, dz]);
    let across = [(ox, dx), (oy, dy), (oz, dz)].map(|(o, d)| multiply_add::<FUSED>(-middle, d, o));
    // Choose the first intersection that does not lie before `t_min`
    let half = (sphere.radius_squared - dot(across, across)).sqrt();
    let near = middle - half;
    let t_min = packet.t_min[lane];
    let t = if near >= t_min { near } else { middle + half };
    // The comparison is false for NaN, which means that the ray misses.
    (t >= t_min && t <= limit).then_some(t)
}

#[inline(always)]
fn nearest<const FUSED: bool>(
    packet: &RayPacket,
    sphere: &PacketSphere,
    hits: &mut TreeHits,
) -> u32 {
    let mut tied = 0;
    for lane in 0..PACKET_SIZE {
        let Some(t) = distance::<FUSED>(packet, lane, sphere, hits.t[lane]) else {
            continue;
        };
        if t == hits.t[lane] && hits.slot[lane] != TreeHits::NO_SLOT {
            tied |= 1 << lane;
        } else {
            hits.t[lane] = t;
            hits.slot[lane] = sphere.slot;
        }
    }
    tied
}

#[inline(always)]
fn any<const FUSED: bool>(packet: &RayPacket, sphere: &PacketSphere, hits: &TreeHits) -> u32 {
    (0..PACKET_SIZE)
        .filter(|lane| distance::<FUSED>(packet, *lane, sphere, hits.t[*lane]).is_some())
        .fold(0, |lanes, lane| lanes | 1 << lane)
}

/// Where rays intersect the planes of a node along one axis: at `step * plane + base`, within `slack`.
struct AxisSlabs {
    step: [f32; PACKET_SIZE],
    base: [f32; PACKET_SIZE],
    slack: [f32; PACKET_SIZE],
}

impl AxisSlabs {
    #[inline(always)]
    fn new(rays: &LaneSlabs, node: &Node, axis: usize) -> Self {
        let scale = f32::from_bits(u32::from(node.exponent[axis]) << 23);
        let mut slabs =
            Self { step: [0.0; PACKET_SIZE], base: [0.0; PACKET_SIZE], slack: [0.0; PACKET_SIZE] };
        for lane in 0..PACKET_SIZE {
            let inverse = rays.inverse[axis][lane];
            let step = scale * inverse;
            let base = (node.origin[axis] - rays.origin[axis][lane]) * inverse;
            let terms = step.abs() * 255.0 + base.abs();
            slabs.step[lane] = step;
            slabs.base[lane] = base;
            slabs.slack[lane] = terms * SLAB_SLACK + rays.reach[axis][lane];
        }
        slabs
    }

    /// Clips the rays to the slab within `half` of `middle`, in units of planes. A NaN is no bound.
    #[inline(always)]
    fn clip(
        &self,
        middle: f32,
        half: f32,
        near: &mut [f32; PACKET_SIZE],
        far: &mut [f32; PACKET_SIZE],
    ) {
        for lane in 0..PACKET_SIZE {
            let at = middle * self.step[lane] + self.base[lane];
            let extent = half * self.step[lane].abs() + self.slack[lane];
            near[lane] = larger(at - extent, near[lane]);
            far[lane] = smaller(at + extent, far[lane]);
        }
    }
}

impl<K: LoopPackets> PacketKernel for K {
    fn test_node_with_beam(self, beam: &Beam, node: &Node, limit: f32) -> (usize, [u32; WIDTH]) {
        let mut near = [beam.t_min; WIDTH];
        let mut far = [limit; WIDTH];
        for axis in 0..3 {
            // Compute the distance of the node from the bounds of the origins, with slack
            let step = f32::from_bits(u32::from(node.exponent[axis]) << 23);
            let from_near = node.origin[axis] - beam.origin_near[axis];
            let from_far = node.origin[axis] - beam.origin_far[axis];
            let terms = from_near.abs().max(from_far.abs()) + 255.0 * step;
            let slack = (terms * SLAB_SLACK + beam.padding) * beam.sign[axis];
            // Clip each child to its slab, with interval arithmetic over the inverse directions
            let [least, greatest] = [beam.inverse[0][axis], beam.inverse[1][axis]];
            let side = beam.near_side[axis];
            for slot in 0..WIDTH {
                let first = f32::from(node.planes[axis][side][slot]) * step + (from_near - slack);
                let second =
                    f32::from(node.planes[axis][1 - side][slot]) * step + (from_far + slack);
                near[slot] = near[slot].max((first * least).min(first * greatest));
                far[slot] = far[slot].min((second * least).max(second * greatest));
            }
        }
        keys_of(node, &near, &far)
    }

    fn test_node_with_lanes(
        self,
        rays: &LaneSlabs,
        node: &Node,
        alive: u32,
        limits: &[f32; PACKET_SIZE],
        entered: &mut EnteredChildren,
    ) -> usize {
        let slabs = [
            AxisSlabs::new(rays, node, 0),
            AxisSlabs::new(rays, node, 1),
            AxisSlabs::new(rays, node, 2),
        ];
        let mut found = 0;
        for slot in 0..node.child_count() {
            // Clip all rays to the box of the child
            let mut near = rays.t_min;
            let mut far = *limits;
            for (axis, slab) in slabs.iter().enumerate() {
                let [first, second] = &node.planes[axis];
                let (first, second) = (f32::from(first[slot]), f32::from(second[slot]));
                let (middle, half) = (0.5 * (first + second), 0.5 * (second - first));
                slab.clip(middle, half, &mut near, &mut far);
            }
            // Store the entry distance of each ray, and the least one as the key of the child
            let mut any = false;
            for lane in 0..PACKET_SIZE {
                let is_entered = alive >> lane & 1 == 1 && near[lane] <= far[lane];
                near[lane] = if is_entered { near[lane] } else { f32::INFINITY };
                any |= is_entered;
            }
            if any {
                entered.near[slot] = near;
                entered.keys[found] = key_of(fold(near, smaller), slot);
                found += 1;
            }
        }
        found
    }

    fn lanes_within(self, near: &[f32; PACKET_SIZE], limits: &[f32; PACKET_SIZE]) -> u32 {
        let mut lanes = 0;
        for lane in 0..PACKET_SIZE {
            lanes |= u32::from(near[lane] <= limits[lane]) << lane;
        }
        lanes
    }

    fn spheres_in_beam(
        self,
        beam: &Beam,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> u32 {
        let mut lanes = 0;
        for lane in 0..BLOCK_SIZE {
            let radius = radii.map_or(beam.radius, |r| r.0[lane]);
            // Compute the position along the central ray, and the squared distance from it
            let to_center = block.center(lane) - beam.center;
            let middle = to_center.dot(beam.axis);
            let across = (to_center - beam.axis * middle).length_squared();
            // Compare with the radius of the cone there
            let tip = radius + beam.spread;
            let reach = tip + beam.growth * (middle + tip).max(0.0);
            // Written as `!(a > b)` so that NaN counts as inside; the tests of the rays then decide.
            let outside = across > reach * reach || middle - reach > limit;
            lanes |= u32::from(!outside) << lane;
        }
        lanes
    }

    fn nearest_of_packet(
        self,
        packet: &RayPacket,
        sphere: &PacketSphere,
        hits: &mut TreeHits,
    ) -> u32 {
        if K::FUSED {
            nearest::<true>(packet, sphere, hits)
        } else {
            nearest::<false>(packet, sphere, hits)
        }
    }

    fn any_of_packet(self, packet: &RayPacket, sphere: &PacketSphere, hits: &TreeHits) -> u32 {
        if K::FUSED {
            any::<true>(packet, sphere, hits)
        } else {
            any::<false>(packet, sphere, hits)
        }
    }
}

/// Keys of the children whose entry distance does not exceed their exit distance, and their number.
pub(super) fn keys_of(
    node: &Node,
    near: &[f32; WIDTH],
    far: &[f32; WIDTH],
) -> (usize, [u32; WIDTH]) {
    let mut keys = [0; WIDTH];
    let mut found = 0;
    for slot in 0..node.child_count() {
        if near[slot] <= far[slot] {
            #[expect(clippy::cast_possible_truncation, reason = "slots are under eight")]
            {
                keys[found] = (near[slot].to_bits() & !7) | slot as u32;
            }
            found += 1;
        }
    }
    (found, keys)
}
