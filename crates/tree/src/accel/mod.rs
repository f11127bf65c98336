//! Acceleration structures: they take particles and return a tree that answers nearest-hit and any-hit queries.
//!
//! There are several builders and one traversal. Every structure ends as a [`wide::WideTree`]: 8-wide nodes of one
//! cache line over blocks of 16 particles. It is rebuilt for every frame in buffers that are reused, it is traced
//! through a [`view::TreeView`], and it is described by one [`BuildReport`]. This module knows nothing about shading,
//! files or jobs.
//!
//! This example builds a tree over two spheres and traces one ray:
//!
//! ```
//! use glam::Vec3;
//! use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
//! use spherule_tree::ray::Ray;
//!
//! let centers = [Vec3::ZERO, Vec3::new(3.0, 0.0, 0.0)];
//! let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(0.5) };
//! let mut builder = TreeBuilder::new();
//! builder.build(&spheres, &BuildSettings::default());
//! let tree = builder.tree().view();
//! let hit = tree.nearest(&Ray::new(Vec3::new(-2.0, 0.0, 0.0), Vec3::X)).expect("a hit");
//! assert_eq!(hit.t, 1.5);
//! assert_eq!(tree.particle(hit.slot), 0);
//! ```

use glam::Vec3;

mod binary;
mod builder;
mod bvh;
mod choose;
mod collapse;
mod collapse_nodes;
mod coverage;
mod hits;
mod hybrid;
pub mod intervals;
mod isolated;
mod kdtree;
mod lbvh;
mod leaves;
mod levels;
mod linked;
pub mod moving;
mod neighbours;
mod pack_leaves;
mod packet;
mod ploc;
mod predict;
mod preset;
mod report;
mod sbvh;
mod settings;
pub mod simd;
pub mod stored;
mod top_levels;
mod topology;
pub mod traverse;
mod tree_fault;
mod validate;
pub mod view;
mod walk;
pub mod wide;

pub use crate::blocks::Aabb;
pub use builder::TreeBuilder;
pub use choose::choose;
pub use hits::{Coherence, TreeHits};
pub use predict::{BuildBytes, predicted_bytes, predicted_stored_bytes, sorting_bytes};
pub use preset::BvhPreset;
pub use report::{BuildReport, Phase};
pub use settings::{BuildSettings, BvhLeaves, BvhSettings, SbvhSettings, Structure};
pub use tree_fault::{ChildFault, ParticleFault, TreeFault};

/// Radii of the spheres of a frame, scene units.
#[derive(Debug, Clone, Copy)]
pub enum SphereRadius<'a> {
    /// One radius for all spheres.
    Common(f32),
    /// One radius per sphere, in particle order.
    Each(&'a [f32]),
}

/// Input of a builder: the spheres of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Spheres<'a> {
    /// Centres, all finite.
    pub centers: &'a [Vec3],
    /// Radii.
    pub radius: SphereRadius<'a>,
}

#[cfg(test)]
mod collapse_tests;
#[cfg(test)]
mod oracle;
#[cfg(test)]
mod tests;
