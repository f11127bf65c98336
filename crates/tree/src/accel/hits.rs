//! Hits of the rays of a packet, lane by lane.

use crate::math::{fold, larger};
use crate::ray::{PACKET_SIZE, RayPacket};

/// Coherence of the rays of a packet. It selects the traversal, and never affects what the rays hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coherence {
    /// Close together and in nearly the same direction: boxes and spheres are tested with one beam around the rays.
    Coherent,
    /// Any rays: each box is tested with each ray.
    Incoherent,
}

/// The first hit of each ray of a packet: distance and slot in tree order.
///
/// During a traversal, `t` is the largest distance of interest (inclusive), and negative for rays that are finished.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct TreeHits {
    /// Distances along the rays; unspecified for rays without a hit.
    pub t: [f32; PACKET_SIZE],
    /// Slots of the particles in tree order, or [`TreeHits::NO_SLOT`].
    pub slot: [u32; PACKET_SIZE],
}

impl Default for TreeHits {
    fn default() -> Self {
        Self { t: [-1.0; PACKET_SIZE], slot: [Self::NO_SLOT; PACKET_SIZE] }
    }
}

impl TreeHits {
    /// The slot of a ray without a hit.
    pub const NO_SLOT: u32 = u32::MAX;

    /// Bit mask of the lanes with a hit.
    #[inline(always)]
    pub fn mask(&self) -> u32 {
        let mut mask = 0;
        for (lane, slot) in self.slot.iter().enumerate() {
            mask |= u32::from(*slot != Self::NO_SLOT) << lane;
        }
        mask
    }

    /// Starts a traversal: the rays in `lanes` are limited by their `t_max`, all others are finished.
    #[inline(always)]
    pub(super) fn start(&mut self, packet: &RayPacket, lanes: u32) {
        for (lane, limit) in self.t.iter_mut().enumerate() {
            // `t_max` is exclusive, but limits are inclusive because of ties.
            let end = packet.t_max[lane].next_down();
            *limit = if lanes >> lane & 1 == 1 { end } else { -1.0 };
        }
        self.slot = [Self::NO_SLOT; PACKET_SIZE];
    }

    /// The largest limit of all rays.
    #[inline(always)]
    pub(super) fn farthest(&self) -> f32 {
        fold(self.t, larger)
    }

    /// Marks the rays in `lanes` as finished.
    #[inline(always)]
    pub(super) fn finish(&mut self, lanes: u32) {
        for (lane, limit) in self.t.iter_mut().enumerate() {
            if lanes >> lane & 1 == 1 {
                *limit = -1.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes_in;

    #[test]
    fn the_mask_has_a_bit_for_each_lane_that_hit() {
        let mut hits = TreeHits::default();
        assert_eq!(hits.mask(), 0);
        hits.slot[3] = 0;
        hits.slot[15] = 7;
        assert_eq!(hits.mask(), 1 << 3 | 1 << 15);
        assert_eq!(lanes_in(hits.mask()).collect::<Vec<_>>(), [3, 15]);
    }
}
