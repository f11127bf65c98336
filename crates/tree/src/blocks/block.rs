//! Blocks of 16 particles. A block is the unit of storage, a leaf of the tree, and the input of one SIMD test.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Aabb;

/// Particles in a block. 16 fills one AVX-512 register; with 8, tracing was 15-22 % slower, with 32 about equal.
pub const BLOCK_SIZE: usize = 16;

/// Centres of 16 particles, one array per axis. The unused lanes of a frame's last block repeat its last particle.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Block {
    /// x of each particle.
    pub x: [f32; BLOCK_SIZE],
    /// y of each particle.
    pub y: [f32; BLOCK_SIZE],
    /// z of each particle.
    pub z: [f32; BLOCK_SIZE],
}

/// Radii of the particles of a block, if radii differ.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct BlockRadii(pub [f32; BLOCK_SIZE]);

impl Block {
    /// Converts a block whose memory still contains 16 consecutive points to one array per axis.
    #[inline]
    pub fn transpose_points(&mut self) {
        let points: [Vec3; BLOCK_SIZE] = bytemuck::cast(*self);
        for (lane, p) in points.iter().enumerate() {
            self.x[lane] = p.x;
            self.y[lane] = p.y;
            self.z[lane] = p.z;
        }
    }

    /// Centre of the particle in `lane`.
    #[inline]
    pub fn center(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    /// All centres, including those of unused lanes.
    #[inline]
    pub fn centers(self) -> impl Iterator<Item = Vec3> {
        (0..BLOCK_SIZE).map(move |lane| self.center(lane))
    }

    /// Moves the particle in `lane` to `center`.
    #[inline]
    pub fn set_center(&mut self, lane: usize, center: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = (center.x, center.y, center.z);
    }

    /// Bounding box of the centres.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        let min = |v: &[f32; BLOCK_SIZE]| v.iter().fold(f32::INFINITY, |a, b| a.min(*b));
        let max = |v: &[f32; BLOCK_SIZE]| v.iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
        Aabb {
            min: Vec3::new(min(&self.x), min(&self.y), min(&self.z)),
            max: Vec3::new(max(&self.x), max(&self.y), max(&self.z)),
        }
    }

    /// Bounding box of the spheres.
    #[inline]
    pub fn sphere_bounds(&self, radii: &BlockRadii) -> Aabb {
        let rounded = (0..BLOCK_SIZE).fold(Aabb::EMPTY, |b, lane| {
            let center = self.center(lane);
            b.union(Aabb { min: center, max: center }.padded(radii.0[lane]))
        });
        rounded.rounded_outwards()
    }
}
