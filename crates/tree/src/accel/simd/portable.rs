//! Plain loops over lanes, for machines without a kernel of their own, and as the reference for the other kernels.

use glam::Vec3;

use super::loop_packet::{LoopPackets, keys_of};
use super::{BlockCrossings, Kernel, SLAB_SLACK};
use crate::blocks::{BLOCK_SIZE, Block, BlockRadii};
use crate::blocks::{Node, WIDTH};
use crate::ray::Ray;

/// The portable kernel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Portable;

/// A ray with the constants of its tests.
pub(super) struct PreparedRay {
    ray: Ray,
    inverse: Vec3,
    radius: f32,
    padding: f32,
}

impl PreparedRay {
    /// Squared radius of the sphere in `lane`.
    fn radius_squared(&self, radii: Option<&BlockRadii>, lane: usize) -> f32 {
        let radius = radii.map_or(self.radius, |r| r.0[lane]);
        radius * radius
    }

    /// Midpoint distance and half length of the chord for each lane; the half length is NaN if the line misses the
    /// sphere. The distance of the line from the centre is computed from the difference vector (Haines et al. 2019,
    /// "Precision Improvements for Ray/Sphere Intersection").
    fn chords(&self, block: &Block, radii: Option<&BlockRadii>) -> [(f32, f32); BLOCK_SIZE] {
        std::array::from_fn(|lane| {
            let to_center = block.center(lane) - self.ray.origin;
            let middle = to_center.dot(self.ray.direction);
            let across = to_center - self.ray.direction * middle;
            let discriminant = self.radius_squared(radii, lane) - across.length_squared();
            (middle, discriminant.sqrt())
        })
    }

    /// The hit distance for each lane, or NaN.
    fn distances(&self, block: &Block, radii: Option<&BlockRadii>) -> [f32; BLOCK_SIZE] {
        self.chords(block, radii).map(|(middle, half)| {
            let near = middle - half;
            if near >= self.ray.t_min { near } else { middle + half }
        })
    }
}

impl LoopPackets for Portable {
    const FUSED: bool = false;
}

impl Kernel for Portable {
    type Ray = PreparedRay;
    type Keys = [u32; WIDTH];

    fn prepare(self, ray: &Ray, inverse: Vec3, radius: f32, padding: f32) -> PreparedRay {
        PreparedRay { ray: *ray, inverse, radius, padding }
    }

    fn test_node(self, ray: &PreparedRay, node: &Node, limit: f32) -> (usize, [u32; WIDTH]) {
        let mut near = [ray.ray.t_min.max(0.0); WIDTH];
        let mut far = [limit; WIDTH];
        for axis in 0..3 {
            // Convert the grid of the node to distances along the ray, with slack
            let inverse = ray.inverse[axis];
            let step = f32::from_bits(u32::from(node.exponent[axis]) << 23) * inverse;
            let base = (node.origin[axis] - ray.ray.origin[axis]) * inverse;
            let slack =
                (base.abs() + 255.0 * step.abs()) * SLAB_SLACK + ray.padding * inverse.abs();
            // Clip the ray to the slab of each child
            let side = usize::from(inverse < 0.0);
            for slot in 0..WIDTH {
                let enter = f32::from(node.planes[axis][side][slot]) * step + (base - slack);
                let leave = f32::from(node.planes[axis][1 - side][slot]) * step + (base + slack);
                near[slot] = near[slot].max(enter);
                far[slot] = far[slot].min(leave);
            }
        }
        keys_of(node, &near, &far)
    }

    fn first_two(self, keys: [u32; WIDTH]) -> [u32; 2] {
        [keys[0], keys[1]]
    }

    fn all_keys(self, keys: [u32; WIDTH]) -> [u32; WIDTH] {
        keys
    }

    fn nearest_in_block(
        self,
        ray: &PreparedRay,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)> {
        // Keep the nearest distance and all lanes with it
        let mut best = limit;
        let mut lanes = 0;
        for (lane, t) in ray.distances(block, radii).into_iter().enumerate() {
            if t >= ray.ray.t_min && t <= best {
                lanes = if t < best { 0 } else { lanes };
                best = t;
                lanes |= 1 << lane;
            }
        }
        (lanes != 0).then_some((best, lanes))
    }

    fn any_in_block(
        self,
        ray: &PreparedRay,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> bool {
        let distances = ray.distances(block, radii);
        distances.iter().any(|t| *t >= ray.ray.t_min && *t <= limit)
    }

    fn all_in_block(
        self,
        ray: &PreparedRay,
        block: &Block,
        radii: Option<&BlockRadii>,
    ) -> BlockCrossings {
        let chords = ray.chords(block, radii);
        let mut found = BlockCrossings::NONE;
        for (lane, (middle, half)) in chords.into_iter().enumerate() {
            if half >= 0.0 {
                found.lanes |= 1 << lane;
                found.near[lane] = middle - half;
                found.far[lane] = middle + half;
            }
        }
        found
    }

    fn prefetch<T>(self, _value: &T) {}
}
