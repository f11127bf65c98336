//! Packet queries, and the traversal for coherent packets: one traversal for up to 16 rays, with a beam around them.
//! Packets without a beam use [`super::hybrid`].
//!
//! Nodes and blocks are tested with the beam. Only spheres inside the beam are tested with the rays, all rays at
//! once. Each ray finds exactly what it would find alone, to the bit.

use std::borrow::Borrow;

use super::hits::{Coherence, TreeHits};
use super::leaves::{Leaves, LoadedRadii};
use super::simd::{Beam, PacketKernel, PacketSphere, lanes_entering};
use super::topology::Topology;
use super::traverse::TreeHit;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::{Walker, walk_with};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii, Node};
use crate::math::{first_lanes, lanes_in};
use crate::ray::{PACKET_SIZE, RayPacket};

impl TreeView<'_> {
    /// [`TreeView::nearest`] for each ray.
    pub fn nearest_lanes(&self, rays: &RayPacket, coherence: Coherence, hits: &mut TreeHits) {
        let lanes = match coherence {
            Coherence::Coherent => self.run(NearestInBeam { rays, hits }),
            Coherence::Incoherent => ALL_LANES,
        };
        if lanes != 0 {
            self.nearest_by_lanes(rays, lanes, hits);
        }
    }

    /// [`TreeView::any_hit`] for each ray, as a bit mask of lanes.
    pub fn occluded_lanes(&self, rays: &RayPacket, coherence: Coherence) -> u32 {
        let (occluded, lanes) = match coherence {
            Coherence::Coherent => self.run(AnyInBeam { rays }),
            Coherence::Incoherent => (0, ALL_LANES),
        };
        if lanes == 0 { occluded } else { occluded | self.occluded_by_lanes(rays, lanes) }
    }

    /// [`TreeView::nearest_lanes`] for coherent rays.
    pub fn nearest_packet(&self, packet: &RayPacket) -> [Option<TreeHit>; PACKET_SIZE] {
        let mut hits = TreeHits::default();
        self.nearest_lanes(packet, Coherence::Coherent, &mut hits);
        std::array::from_fn(|lane| {
            let (t, slot) = (hits.t[lane], hits.slot[lane]);
            (slot != TreeHits::NO_SLOT).then_some(TreeHit { t, slot })
        })
    }

    /// [`TreeView::occluded_lanes`] for coherent rays.
    pub fn any_hit_packet(&self, packet: &RayPacket) -> u32 {
        self.occluded_lanes(packet, Coherence::Coherent)
    }
}

/// All rays of a packet.
const ALL_LANES: u32 = first_lanes(PACKET_SIZE);

/// Number of blocks after which the rays of a beam are traced again without it. Such a beam is too wide for the
/// spheres (its rays start far apart), and tests many spheres that few of its rays hit. On the thesis's box, beams
/// around neighbouring pixels rarely need half as many blocks.
const MAX_BEAM_BLOCKS: u32 = 64;

/// A block in a form for tests with packets.
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
        let radius = match self.radii {
            Some(radii) => radii.0[lane],
            None => self.radius,
        };
        #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
        PacketSphere {
            center: [centers.x[lane], centers.y[lane], centers.z[lane]],
            radius_squared: radius * radius,
            slot: (self.index * BLOCK_SIZE + lane) as u32,
        }
    }
}

/// Finds the nearest hits with a beam around the rays. Returns the lanes that must be traced without a beam. Their
/// entries in `hits` must not be used as limits: boxes are rounded, so a shortened ray could miss a hit just in front
/// of the one found.
struct NearestInBeam<'r, 'h> {
    rays: &'r RayPacket,
    hits: &'h mut TreeHits,
}

impl TreeTask for NearestInBeam<'_, '_> {
    type Output = u32;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> u32 {
        let (rays, hits, view) = (self.rays, self.hits, tree.view);
        // Select the rays that reach the tree
        let lanes = lanes_entering(rays, &view.bounds);
        hits.start(rays, lanes);
        if lanes == 0 {
            return 0;
        }
        let Some(beam) = Beam::around(rays, lanes, view.radius, view.padding) else {
            return lanes;
        };
        // Traverse the tree with the beam; give up after too many blocks
        let limit = hits.farthest();
        let mut search =
            NearestOfBeam { tree, beam: &beam, rays, hits, blocks_left: MAX_BEAM_BLOCKS };
        walk_with(kernel, tree, &mut search, limit);
        if search.blocks_left == 0 { lanes } else { 0 }
    }
}

/// A beam of rays that search for their nearest hits.
struct NearestOfBeam<'r, 'a, T, L> {
    tree: Resolved<'a, T, L>,
    beam: &'r Beam,
    rays: &'r RayPacket,
    hits: &'r mut TreeHits,
    blocks_left: u32,
}

impl<'a, K: PacketKernel, T: Topology<'a>, L: Leaves> Walker<K> for NearestOfBeam<'_, 'a, T, L> {
    #[inline(always)]
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        kernel.test_node_with_beam(self.beam, node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, kernel: K, index: usize, limit: f32) -> f32 {
        // Find the spheres of the block that the beam touches
        let view = self.tree.view;
        let centers = self.tree.leaves.load(kernel, index);
        let radii = LoadedRadii::of(&view.radii, index);
        let (centers, radii) = (centers.borrow(), radii.as_ref());
        let found = kernel.spheres_in_beam(self.beam, centers, radii, limit);
        let block = PacketBlock { index, centers, radii, radius: view.radius };
        // Test each of these spheres with all rays
        for lane in lanes_in(found) {
            let sphere = block.sphere(lane);
            let tied = kernel.nearest_of_packet(self.rays, &sphere, self.hits);
            if tied != 0 {
                resolve_ties(view, tied, sphere.slot, self.hits);
            }
        }
        // Stop if the beam visits too many blocks
        self.blocks_left -= 1;
        if self.blocks_left == 0 {
            return -1.0;
        }
        self.hits.farthest()
    }
}

/// Stores `slot` in those of the `tied` lanes whose current slot it precedes.
#[cold]
fn resolve_ties(tree: &TreeView, tied: u32, slot: u32, hits: &mut TreeHits) {
    for lane in lanes_in(tied) {
        let held = &mut hits.slot[lane];
        if tree.tie_order(slot, *held).is_lt() {
            *held = slot;
        }
    }
}

/// Finds the rays with any hit, with a beam around the rays. Returns their lanes, and the lanes that must be traced
/// without a beam.
struct AnyInBeam<'r> {
    rays: &'r RayPacket,
}

impl TreeTask for AnyInBeam<'_> {
    type Output = (u32, u32);

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> (u32, u32) {
        let (rays, view) = (self.rays, tree.view);
        let lanes = lanes_entering(rays, &view.bounds);
        if lanes == 0 {
            return (0, 0);
        }
        let mut hits = TreeHits::default();
        hits.start(rays, lanes);
        let Some(beam) = Beam::around(rays, lanes, view.radius, view.padding) else {
            return (0, lanes);
        };
        // Traverse the tree with the beam; give up after too many blocks
        let limit = hits.farthest();
        let mut search =
            AnyOfBeam { tree, beam: &beam, rays, hits, occluded: 0, blocks_left: MAX_BEAM_BLOCKS };
        walk_with(kernel, tree, &mut search, limit);
        let occluded = search.occluded;
        let is_decided = search.blocks_left > 0;
        (occluded, if is_decided { 0 } else { lanes & !occluded })
    }
}

/// A beam of rays that search for any hit.
struct AnyOfBeam<'r, 'a, T, L> {
    tree: Resolved<'a, T, L>,
    beam: &'r Beam,
    rays: &'r RayPacket,
    hits: TreeHits,
    occluded: u32,
    blocks_left: u32,
}

impl<'a, K: PacketKernel, T: Topology<'a>, L: Leaves> Walker<K> for AnyOfBeam<'_, 'a, T, L> {
    #[inline(always)]
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        kernel.test_node_with_beam(self.beam, node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, kernel: K, index: usize, mut limit: f32) -> f32 {
        let view = self.tree.view;
        let centers = self.tree.leaves.load(kernel, index);
        let radii = LoadedRadii::of(&view.radii, index);
        let (centers, radii) = (centers.borrow(), radii.as_ref());
        // Find the spheres of the block that the beam touches
        let inside = kernel.spheres_in_beam(self.beam, centers, radii, limit);
        let block = PacketBlock { index, centers, radii, radius: view.radius };
        // Test each of these spheres with all rays that are not occluded yet
        let mut found = 0;
        for lane in lanes_in(inside) {
            found |= kernel.any_of_packet(self.rays, &block.sphere(lane), &self.hits);
        }
        if found != 0 {
            self.occluded |= found;
            self.hits.finish(found);
            limit = self.hits.farthest();
        }
        self.blocks_left -= 1;
        if self.blocks_left == 0 { -1.0 } else { limit }
    }
}
