//! What tracing 16 rays together needs of the machine.

use super::{Beam, Kernel};
use crate::ray::{PACKET_SIZE, RayPacket};
use spherule_formats::blocks::Node;
use spherule_formats::blocks::{Block, BlockRadii};

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

/// What each ray of a packet has found. A limit is the farthest distance that still counts, so the
/// distance of the hit where there is one; negative for rays that are done.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(in super::super) struct LaneHits {
    /// Farthest distance that counts, inclusive.
    pub(in super::super) limit: [f32; PACKET_SIZE],
    /// Place of the sphere hit in tree order, or [`Self::NO_SLOT`].
    pub(in super::super) slot: [u32; PACKET_SIZE],
}

impl LaneHits {
    /// Nothing was hit.
    pub(in super::super) const NO_SLOT: u32 = u32::MAX;

    /// The farthest distance that counts for any ray.
    #[inline(always)]
    pub(in super::super) fn farthest(&self) -> f32 {
        super::beam::fold(self.limit, super::beam::larger)
    }

    /// Nothing counts any more for the rays in `lanes`.
    #[inline(always)]
    pub(in super::super) fn finish(&mut self, lanes: u32) {
        for (lane, limit) in self.limit.iter_mut().enumerate() {
            if lanes >> lane & 1 == 1 {
                *limit = -1.0;
            }
        }
    }
}

/// Tests of packets. Each ray meets each sphere at the same distance, to the bit, as by
/// [`Kernel::nearest_in_block`].
pub(in super::super) trait PacketKernel: Kernel {
    /// As [`Kernel::test_node`], of the children that some ray of `beam` may enter; a key's distance is
    /// the least at which one does.
    fn test_node_with_beam(self, beam: &Beam, node: &Node, limit: f32) -> (usize, Self::Keys);

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
        hits: &mut LaneHits,
    ) -> u32;

    /// The lanes whose rays meet `sphere` up to their limits.
    fn any_of_packet(self, packet: &RayPacket, sphere: &PacketSphere, hits: &LaneHits) -> u32;
}
