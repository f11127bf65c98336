//! Where a packet of rays may begin: the space around the bricks, one brick wider on every side.
//!
//! A ray that is not there has only empty bricks around it, and so has every ray within a brick's edge of it: one
//! ray finds the way for all of a packet up to there. Most packets of a picture never come there.

use super::blocks::{key_of, merged, place_of};
use super::brick::VOXELS;
use super::tree::{Block, BrickTree, Node};
use crate::ray::{PACKET_SIZE, Ray, RayPacket};
use crate::surface::Side;

/// Part of a brick's edge that rays of a packet may be apart.
const APART: f32 = 0.95;

/// See the module.
#[derive(Debug, Default)]
pub(super) struct NearSpace(BrickTree);

impl NearSpace {
    /// Around the bricks of `blocks` with voxels of this edge.
    pub(super) fn around(blocks: &[Block], voxel: f32) -> Self {
        let occupied =
            |block: &Block| (key_of(block.place), block.node.children | block.node.inside);
        let mut cells: Vec<(u64, u64)> = blocks.iter().map(occupied).collect();
        for axis in 0..3 {
            cells = widened(&cells, axis);
        }
        let block = |&(key, inside): &(u64, u64)| Block {
            place: place_of(key),
            node: Node {
                inside,
                ..Node::default()
            },
        };
        let blocks: Vec<Block> = cells.iter().map(block).collect();
        Self(BrickTree::new(&blocks, Vec::new(), voxel, 0.0))
    }

    pub(super) fn byte_len(&self) -> u64 {
        self.0.byte_len()
    }

    /// The distance up to which no ray of `packet`, all of them outside, meets any brick.
    #[inline(always)]
    pub(super) fn free_way(&self, packet: &RayPacket) -> f32 {
        let first = packet.ray(0);
        let (mut apart, mut spread, mut t_max) = (0.0_f32, 0.0_f32, first.t_max);
        for lane in 1..packet.len().min(PACKET_SIZE) {
            let ray = packet.ray(lane);
            apart = apart.max(ray.origin.distance_squared(first.origin));
            spread = spread.max(ray.direction.distance_squared(first.direction));
            t_max = t_max.max(ray.t_max);
        }
        let room = APART * VOXELS as f32 * self.0.voxel() - apart.sqrt();
        // Also for rays that are no numbers.
        if room.partial_cmp(&0.0).is_none_or(|order| order.is_le()) {
            return 0.0;
        }
        let together = room / spread.sqrt();
        let way = Ray {
            t_min: 0.0,
            t_max: t_max.min(together),
            ..first
        };
        let met = self.0.first_crossing(&way, Side::Outside);
        met.map_or(way.t_max, |met| met.t)
    }
}

/// Cells and their neighbours along an axis.
fn widened(cells: &[(u64, u64)], axis: usize) -> Vec<(u64, u64)> {
    let shift = 2 * axis;
    // The cells at either end of a block along the axis.
    let first = (0..64)
        .filter(|cell| cell >> shift & 3 == 0)
        .fold(0_u64, |bits, cell| bits | 1 << cell);
    let last = first << (3 * (1 << shift));
    let step = 1 << shift;
    let mut found = Vec::with_capacity(3 * cells.len());
    for (key, bits) in cells {
        let up = (bits & !last) << step;
        let down = (bits & !first) >> step;
        found.push((*key, bits | up | down));
        let neighbour = |by: i32| {
            let mut place = place_of(*key);
            place[axis] += by;
            key_of(place)
        };
        for (by, spill) in [
            (1, (bits & last) >> (3 * step)),
            (-1, (bits & first) << (3 * step)),
        ] {
            if spill != 0 {
                found.push((neighbour(by), spill));
            }
        }
    }
    merged(found)
}

/// A ray of a packet from where it may meet something; None if it ends before.
#[inline(always)]
pub(super) fn rest_of(ray: &Ray, free: f32) -> Option<Ray> {
    let t_min = ray.t_min.max(free);
    (t_min < ray.t_max).then_some(Ray { t_min, ..*ray })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn neighbours_along_each_axis_are_near() {
        let block = Block {
            place: [5, -3, 0],
            node: Node {
                children: 1 << 3,
                ..Node::default()
            },
        };
        let near = NearSpace::around(&[block], 1.0);
        // The brick is the last of its block along x, the first along y and z.
        let corner = Vec3::new(5.0 * 32.0 + 24.0, -96.0, 0.0);
        let side = |offset: Vec3| near.0.side_of(corner + offset);
        for (z, y, x) in
            (-1..3).flat_map(|z| (-1..3).flat_map(move |y| (-1..3).map(move |x| (z, y, x))))
        {
            let offset = 8.0 * Vec3::new(x as f32 - 0.5, y as f32 - 0.5, z as f32 - 0.5);
            let is_near = [x, y, z].iter().all(|c| (0..3).contains(c));
            let wanted = if is_near { Side::Inside } else { Side::Outside };
            assert_eq!(side(offset), wanted, "{x} {y} {z}");
        }
    }
}
