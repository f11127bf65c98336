//! Acceleration structures: particles in, a tree that answers nearest and any hit out.
//!
//! One traversal, several builders: every structure ends as a [`wide::WideTree`] (8-wide nodes of
//! one cache line over blocks of 16 particles), is rebuilt for every frame in buffers that live on,
//! is traced through a [`view::TreeView`] and reports itself in one [`BuildReport`]. Shading, files and jobs are none of its business.

use glam::Vec3;

mod binary;
mod builder;
mod bvh;
mod choose;
mod collapse;
mod coverage;
mod hits;
mod hybrid;
pub mod intervals;
mod kdtree;
mod lbvh;
mod leaves;
mod levels;
mod linked;
mod lonely;
mod near;
mod packet;
mod ploc;
mod predict;
mod preset;
mod report;
mod sbvh;
mod settings;
pub mod simd;
pub mod stored;
mod topology;
pub mod traverse;
mod trim;
mod upper;
mod validate;
pub mod view;
mod walk;
pub mod wide;
mod widen;

pub use builder::TreeBuilder;
pub use choose::choose;
pub use hits::{Coherence, TreeHits};
pub use predict::{BuildBytes, predicted_bytes, predicted_stored_bytes};
pub use preset::BvhPreset;
pub use report::{BuildReport, Phase};
pub use settings::{BuildSettings, BvhLeaves, BvhSettings, SbvhSettings, Structure};
pub use spherule_formats::blocks::Aabb;

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

#[cfg(test)]
mod collapse_tests;
#[cfg(test)]
mod oracle;
#[cfg(test)]
mod tests;
