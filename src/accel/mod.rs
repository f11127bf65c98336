//! Acceleration structures: particles in, a tree that answers nearest and any hit out.
//!
//! One traversal, several builders: every structure ends as a [`wide::WideTree`] (8-wide nodes of
//! one cache line over blocks of 16 particles), is rebuilt for every frame in buffers that live on,
//! and reports itself in one [`BuildReport`]. Shading, files and jobs are none of its business.

use std::time::Duration;

use glam::Vec3;

mod aabb;
pub mod block;
pub mod curve;
pub mod lbvh;
mod node;
mod partition;
pub mod simd;
pub mod traverse;
mod upper;
mod validate;
pub mod wide;

pub use aabb::Aabb;

/// Index of a particle in the frame that was built over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct PrimIdx(pub u32);

/// Radii of the spheres of a frame, scene units.
#[derive(Debug, Clone, Copy)]
pub enum SphereRadius<'a> {
    /// One for all.
    Common(f32),
    /// One each, in particle order.
    Each(&'a [f32]),
}

/// What a structure is built over.
#[derive(Debug, Clone, Copy)]
pub struct Spheres<'a> {
    /// Centres, all finite.
    pub centers: &'a [Vec3],
    /// Radii.
    pub radius: SphereRadius<'a>,
}

/// What the builders may be told.
#[derive(Debug, Clone, Copy)]
pub struct BuildSettings {
    /// Keep the way back to the particle's index in the frame (4 bytes a particle): needed for
    /// attributes and ids.
    pub keep_indices: bool,
}

impl Default for BuildSettings {
    fn default() -> Self {
        Self { keep_indices: true }
    }
}

/// One named piece of the build time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Phase {
    /// What was done.
    pub name: &'static str,
    /// Wall-clock time.
    pub time: Duration,
}

/// What a build cost and what came out; the same for every structure.
#[derive(Debug, Clone)]
pub struct BuildReport {
    /// Name of the structure: `lbvh`...
    pub structure: &'static str,
    /// The order that the particles were brought into.
    pub order: &'static str,
    /// Wall-clock time of the whole build.
    pub total: Duration,
    /// The same by phase.
    pub phases: Vec<Phase>,
    /// Particles.
    pub particles: u64,
    /// 8-wide nodes.
    pub nodes: u64,
    /// Leaves (blocks).
    pub leaves: u64,
    /// Node levels from the root to the leaves' parents.
    pub depth: u32,
    /// Expected nodes and blocks tested by a ray that hits the root box (surface area heuristic,
    /// Goldsmith & Salmon 1987, with the radius added to every box and one unit for either test).
    pub sah_cost: f64,
    /// Bytes of the positions and radii in blocks.
    pub position_bytes: u64,
    /// Bytes of the nodes and of the way back to the frame's order.
    pub structure_bytes: u64,
    /// Most bytes held at any time while building, the input not counted.
    pub peak_bytes: u64,
    /// The instruction set that rays are traced with.
    pub simd: &'static str,
}

#[cfg(test)]
mod tests;
