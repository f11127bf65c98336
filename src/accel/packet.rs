//! The traversal for packets: one walk for up to 16 rays, as wide as the beam around them.
//!
//! Nodes and blocks are tested with the beam, and only the spheres inside it with the rays, all of them
//! at once. What each ray finds is what it would find alone, to the bit.

use std::borrow::Borrow;

use super::leaves::{Leaves, LoadedRadii};
use super::simd::{Beam, LaneHits, PacketKernel, PacketSphere, lanes_near};
use super::topology::Topology;
use super::traverse::TreeHit;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::walk;
use crate::ray::{PACKET_SIZE, RayPacket};
use spherule_formats::blocks::{BLOCK_SIZE, Block, BlockRadii};

impl TreeView<'_> {
    /// [`TreeView::nearest`] of each ray.
    pub fn nearest_packet(&self, packet: &RayPacket) -> [Option<TreeHit>; PACKET_SIZE] {
        self.run(NearestOfPacket { packet })
    }

    /// [`TreeView::any_hit`] of each ray, a bit for each lane.
    pub fn any_hit_packet(&self, packet: &RayPacket) -> u32 {
        self.run(AnyOfPacket { packet })
    }
}

/// Blocks after which the rays of a packet go on alone: such a beam is too wide for the spheres (its
/// rays start far apart), and tests many that few of its rays meet. Measured on the thesis's box: beams
/// around pixels that are neighbours seldom need half as many.
const MOST_BLOCKS: u32 = 64;

/// Lanes with these bits.
#[inline(always)]
fn lanes_of(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (bits != 0).then(|| {
            let lane = bits.trailing_zeros() as usize & (PACKET_SIZE - 1);
            bits &= bits - 1;
            lane
        })
    })
}

/// Rays at the start: those in `lanes` count up to their ends, the others not at all.
#[inline(always)]
fn unmet(packet: &RayPacket, lanes: u32) -> LaneHits {
    LaneHits {
        limit: std::array::from_fn(|lane| {
            if lanes >> lane & 1 == 1 {
                // The end is exclusive for the ray and inclusive for ties.
                packet.t_max[lane].next_down()
            } else {
                -1.0
            }
        }),
        slot: [LaneHits::NO_SLOT; PACKET_SIZE],
    }
}

/// A block for a packet.
struct PacketBlock<'a> {
    index: usize,
    centers: &'a Block,
    radii: Option<&'a BlockRadii>,
    /// The common radius.
    radius: f32,
}

impl PacketBlock<'_> {
    /// The sphere in `lane`.
    #[inline(always)]
    fn sphere(&self, lane: usize) -> PacketSphere {
        let centers = self.centers;
        let radius = self.radii.map_or(self.radius, |r| r.0[lane]);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "slots are counted in 32 bits"
        )]
        PacketSphere {
            center: [centers.x[lane], centers.y[lane], centers.z[lane]],
            radius_squared: radius * radius,
            slot: (self.index * BLOCK_SIZE + lane) as u32,
        }
    }
}

struct NearestOfPacket<'r> {
    packet: &'r RayPacket,
}

impl TreeTask for NearestOfPacket<'_> {
    type Output = [Option<TreeHit>; PACKET_SIZE];

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> Self::Output {
        let (packet, view) = (self.packet, tree.view);
        let lanes = lanes_near(packet, &view.bounds);
        if lanes == 0 {
            return [None; PACKET_SIZE];
        }
        let mut hits = unmet(packet, lanes);
        let Some(beam) = Beam::around(packet, lanes, view.radius, view.padding) else {
            return nearest_one_by_one(view, packet, &hits);
        };
        let mut blocks_left = MOST_BLOCKS;
        walk(
            kernel,
            tree,
            |node, limit| kernel.test_node_with_beam(&beam, node, limit),
            hits.farthest(),
            |index, limit| {
                let centers = tree.leaves.load(kernel, index);
                let radii = LoadedRadii::of(&view.radii, index);
                let (centers, radii) = (centers.borrow(), radii.as_ref());
                let found = kernel.spheres_in_beam(&beam, centers, radii, limit);
                let block = PacketBlock {
                    index,
                    centers,
                    radii,
                    radius: view.radius,
                };
                for lane in lanes_of(found) {
                    let sphere = block.sphere(lane);
                    let tied = kernel.nearest_of_packet(packet, &sphere, &mut hits);
                    if tied != 0 {
                        settle_ties(view, tied, sphere.slot, &mut hits);
                    }
                }
                blocks_left -= 1;
                if blocks_left == 0 {
                    return -1.0;
                }
                hits.farthest()
            },
        );
        if blocks_left == 0 {
            return nearest_one_by_one(view, packet, &hits);
        }
        std::array::from_fn(|lane| {
            let (t, slot) = (hits.limit[lane], hits.slot[lane]);
            (slot != LaneHits::NO_SLOT).then_some(TreeHit { t, slot })
        })
    }
}

/// Gives `slot` to those of the `tied` lanes in which it comes before what they have.
#[cold]
fn settle_ties(tree: &TreeView, tied: u32, slot: u32, hits: &mut LaneHits) {
    for lane in lanes_of(tied) {
        let held = &mut hits.slot[lane];
        if tree.tie_order(slot, *held).is_lt() {
            *held = slot;
        }
    }
}

/// Traces those rays alone that a packet has not put aside. What it has found does not shorten them:
/// where boxes are rounded, that could lose a hit just in front of one.
#[cold]
fn nearest_one_by_one(
    tree: &TreeView,
    packet: &RayPacket,
    hits: &LaneHits,
) -> [Option<TreeHit>; PACKET_SIZE] {
    let mut found = [None; PACKET_SIZE];
    for (lane, limit) in hits.limit.into_iter().enumerate() {
        if limit >= 0.0 {
            found[lane] = tree.nearest(&packet.ray(lane));
        }
    }
    found
}

struct AnyOfPacket<'r> {
    packet: &'r RayPacket,
}

impl TreeTask for AnyOfPacket<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> u32 {
        let (packet, view) = (self.packet, tree.view);
        let lanes = lanes_near(packet, &view.bounds);
        if lanes == 0 {
            return 0;
        }
        let mut hits = unmet(packet, lanes);
        let Some(beam) = Beam::around(packet, lanes, view.radius, view.padding) else {
            return any_one_by_one(view, packet, &hits);
        };
        let mut met = 0;
        let mut blocks_left = MOST_BLOCKS;
        walk(
            kernel,
            tree,
            |node, limit| kernel.test_node_with_beam(&beam, node, limit),
            hits.farthest(),
            |index, mut limit| {
                let centers = tree.leaves.load(kernel, index);
                let radii = LoadedRadii::of(&view.radii, index);
                let (centers, radii) = (centers.borrow(), radii.as_ref());
                let inside = kernel.spheres_in_beam(&beam, centers, radii, limit);
                let block = PacketBlock {
                    index,
                    centers,
                    radii,
                    radius: view.radius,
                };
                let mut found = 0;
                for lane in lanes_of(inside) {
                    found |= kernel.any_of_packet(packet, &block.sphere(lane), &hits);
                }
                if found != 0 {
                    met |= found;
                    hits.finish(found);
                    limit = hits.farthest();
                }
                blocks_left -= 1;
                if blocks_left == 0 { -1.0 } else { limit }
            },
        );
        if blocks_left == 0 {
            met |= any_one_by_one(view, packet, &hits);
        }
        met
    }
}

/// Tests those rays alone that a packet left undecided.
#[cold]
fn any_one_by_one(tree: &TreeView, packet: &RayPacket, hits: &LaneHits) -> u32 {
    (0..PACKET_SIZE)
        .filter(|lane| hits.limit[*lane] >= 0.0 && tree.any_hit(&packet.ray(*lane)))
        .fold(0, |met, lane| met | 1 << lane)
}
