//! What tracing 16 rays together needs of the machine.

use super::super::hits::TreeHits;
use super::beam::inverses;
use super::{Beam, Kernel};
use crate::math::larger;
use crate::ray::{PACKET_SIZE, RayPacket};
use spherule_formats::blocks::{Block, BlockRadii, Node, WIDTH};

/// A sphere that each ray of a packet is to be tested with.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct PacketSphere {
    /// Centre.
    pub(in super::super) center: [f32; 3],
    /// Square of the radius.
    pub(in super::super) radius_squared: f32,
    /// Place in tree order.
    pub(in super::super) slot: u32,
}

/// What the rays of a packet need to be tested with boxes, each by itself.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(in super::super) struct LaneSlabs {
    /// Starts, per axis.
    pub(super) origin: [[f32; PACKET_SIZE]; 3],
    /// Inverse directions with every component finite.
    pub(super) inverse: [[f32; PACKET_SIZE]; 3],
    /// Distance that the padding of boxes adds on either side, per axis.
    pub(super) reach: [[f32; PACKET_SIZE]; 3],
    /// Where the rays start to count; not negative.
    pub(super) t_min: [f32; PACKET_SIZE],
}

impl LaneSlabs {
    /// For boxes that lack `padding` on every side.
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
}

/// The children of a node that some rays of a packet enter.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(in super::super) struct EnteredChildren {
    /// By slot: where each ray enters the child, infinite for rays that do not. Only of children that
    /// have a key.
    pub(in super::super) near: [[f32; PACKET_SIZE]; WIDTH],
    /// As [`Kernel::Keys`], with the least distance at which a ray enters; in slot order.
    pub(in super::super) keys: [u32; WIDTH],
}

impl EnteredChildren {
    /// None.
    pub(in super::super) const NONE: Self = Self {
        near: [[f32::INFINITY; PACKET_SIZE]; WIDTH],
        keys: [0; WIDTH],
    };
}

/// Key of the child in `slot`, entered at `distance`.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "slots are under eight")]
pub(super) fn key_of(distance: f32, slot: usize) -> u32 {
    (distance.to_bits() & !7) | slot as u32
}

/// Tests of packets. Each ray meets each sphere at the same distance, to the bit, as by
/// [`Kernel::nearest_in_block`].
pub(in super::super) trait PacketKernel: Kernel {
    /// As [`Kernel::test_node`], of the children that some ray of `beam` may enter; a key's distance is
    /// the least at which one does.
    fn test_node_with_beam(self, beam: &Beam, node: &Node, limit: f32) -> (usize, Self::Keys);

    /// Tests the children of `node` with each ray of `alive` up to its limit. Returns how many children
    /// some ray enters, and writes which and where to `entered`.
    ///
    /// The test is that of [`Kernel::test_node`], but a box is its middle and half its width, so that
    /// the signs of directions need not be looked at: along an axis, the ray is in the box from
    /// `middle - half` to `middle + half`, with the slack in `half`. The terms of the slack are summed
    /// before they are scaled: where a distance would be beyond the range of f32 the slack is infinite,
    /// and the axis gives no bound.
    fn test_node_with_lanes(
        self,
        rays: &LaneSlabs,
        node: &Node,
        alive: u32,
        limits: &[f32; PACKET_SIZE],
        entered: &mut EnteredChildren,
    ) -> usize;

    /// The lanes in which `near` is not beyond the limit.
    fn lanes_within(self, near: &[f32; PACKET_SIZE], limits: &[f32; PACKET_SIZE]) -> u32;

    /// The lanes of `block` whose spheres some ray of `beam` may meet up to `limit`.
    fn spheres_in_beam(
        self,
        beam: &Beam,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> u32;

    /// Tests all rays with `sphere` and keeps nearer hits in `hits`. Returns the lanes that it ties
    /// with what they have.
    fn nearest_of_packet(
        self,
        packet: &RayPacket,
        sphere: &PacketSphere,
        hits: &mut TreeHits,
    ) -> u32;

    /// The lanes whose rays meet `sphere` up to their limits.
    fn any_of_packet(self, packet: &RayPacket, sphere: &PacketSphere, hits: &TreeHits) -> u32;
}
