//! Tests of a packet of 16 rays, for one instruction set.

use glam::Vec3;

use super::super::hits::TreeHits;
use super::beam::inverses;
use super::{Beam, Kernel};
use crate::blocks::{Block, BlockRadii, Node, WIDTH};
use crate::math::larger;
use crate::ray::{PACKET_SIZE, RayPacket};

/// A sphere to be tested with each ray of a packet.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct PacketSphere {
    /// Centre.
    pub(in super::super) center: [f32; 3],
    /// Square of the radius.
    pub(in super::super) radius_squared: f32,
    /// Slot in tree order.
    pub(in super::super) slot: u32,
}

/// The rays of a packet, prepared for tests of each ray with boxes.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(in super::super) struct LaneSlabs {
    /// Origins, per axis.
    pub(super) origin: [[f32; PACKET_SIZE]; 3],
    /// Inverse directions with finite components.
    pub(super) inverse: [[f32; PACKET_SIZE]; 3],
    /// Distance along the ray that the padding of boxes adds on either side, per axis.
    pub(super) reach: [[f32; PACKET_SIZE]; 3],
    /// The `t_min` of the rays, at least 0.
    pub(super) t_min: [f32; PACKET_SIZE],
}

impl LaneSlabs {
    /// Prepares a packet for boxes that must be extended by `padding` on every side.
    #[inline(always)]
    pub(in super::super) fn new(packet: &RayPacket, padding: f32) -> Self {
        let mut slabs = Self {
            origin: packet.origin,
            inverse: [[0.0; PACKET_SIZE]; 3],
            reach: [[0.0; PACKET_SIZE]; 3],
            t_min: packet.t_min,
        };
        for axis in 0..3 {
            slabs.inverse[axis] = inverses(&packet.direction[axis]);
            for lane in 0..PACKET_SIZE {
                slabs.reach[axis][lane] = slabs.inverse[axis][lane].abs() * padding;
            }
        }
        for t_min in &mut slabs.t_min {
            *t_min = larger(*t_min, 0.0);
        }
        slabs
    }

    /// The inverse direction of the ray in `lane`.
    #[inline(always)]
    pub(in super::super) fn inverse(&self, lane: usize) -> Vec3 {
        self.inverse.map(|axis| axis[lane]).into()
    }
}

/// The children of a node that rays of a packet enter.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(in super::super) struct EnteredChildren {
    /// Entry distance of each ray, by slot; infinite for rays that do not enter the child. Valid only for children
    /// with a key.
    pub(in super::super) near: [[f32; PACKET_SIZE]; WIDTH],
    /// Keys as in [`Kernel::Keys`], with the least entry distance of the rays; in slot order.
    pub(in super::super) keys: [u32; WIDTH],
}

impl EnteredChildren {
    /// No children.
    pub(in super::super) const NONE: Self =
        Self { near: [[f32::INFINITY; PACKET_SIZE]; WIDTH], keys: [0; WIDTH] };
}

/// Key of the child in `slot` with the entry distance `distance`.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "slots are under eight")]
pub(super) fn key_of(distance: f32, slot: usize) -> u32 {
    (distance.to_bits() & !7) | slot as u32
}

/// Tests of packets. The hit distance of each ray with each sphere equals that of [`Kernel::nearest_in_block`], to
/// the bit.
pub(in super::super) trait PacketKernel: Kernel {
    /// [`Kernel::test_node`] for the children that some ray of `beam` may enter; the distance in a key is the least
    /// entry distance of the rays.
    fn test_node_with_beam(self, beam: &Beam, node: &Node, limit: f32) -> (usize, Self::Keys);

    /// Tests the children of `node` with each ray of `alive` up to its limit. Returns the number of children that
    /// some ray enters, and writes them and the entry distances to `entered`.
    ///
    /// The test is that of [`Kernel::test_node`], but it represents a box by its midpoint and half its width, which
    /// makes it independent of the signs of the directions: along an axis, the ray is inside the box from `middle -
    /// half` to `middle + half`; the slack is added to `half`. The terms of the slack are summed before they are
    /// scaled: if a distance is beyond the range of f32, the slack is infinite, and the axis gives no bound.
    fn test_node_with_lanes(
        self,
        rays: &LaneSlabs,
        node: &Node,
        alive: u32,
        limits: &[f32; PACKET_SIZE],
        entered: &mut EnteredChildren,
    ) -> usize;

    /// The lanes in which `near` does not exceed the limit.
    fn lanes_within(self, near: &[f32; PACKET_SIZE], limits: &[f32; PACKET_SIZE]) -> u32;

    /// The lanes of `block` whose spheres some ray of `beam` may hit up to `limit`.
    fn spheres_in_beam(
        self,
        beam: &Beam,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> u32;

    /// Tests all rays with `sphere` and stores nearer hits in `hits`. Returns the lanes with a tie between `sphere`
    /// and the current hit.
    fn nearest_of_packet(
        self,
        packet: &RayPacket,
        sphere: &PacketSphere,
        hits: &mut TreeHits,
    ) -> u32;

    /// The lanes whose rays hit `sphere` up to their limits.
    fn any_of_packet(self, packet: &RayPacket, sphere: &PacketSphere, hits: &TreeHits) -> u32;
}
