//! Acceleration structures over spheres: LBVH, BVH, SBVH and k-d tree, rebuilt for every frame.
//!
//! ```text
//! slices of positions and radii -> [tree] -> Tree -> surface -> tracer
//! ```
//!
//! - [`accel`]: builders, and the one tree that all of them produce: 8-wide nodes of one cache line over blocks of 16
//!   particles. Single rays and packets of 16 rays traverse it with the instructions of the machine.
//! - [`blocks`]: the layout of nodes and of blocks of particles in memory and in native frame files.
//! - [`order`]: orders of particles in which neighbours are near each other: curves and k-d partitions.
//! - [`ray`]: rays and packets of rays.
//! - [`math`]: arithmetic on 16 lanes, the same to the bit on all instruction sets.
//!
//! This crate takes slices of positions and radii and returns values. It knows nothing of files, scenes or shading.
//! ARCHITECTURE.md has its invariants.
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
//! let hit = builder.tree().view().nearest(&Ray::new(Vec3::new(-2.0, 0.0, 0.0), Vec3::X));
//! assert_eq!(hit.expect("a hit").t, 1.5);
//! ```
#![deny(unsafe_code)]

pub mod accel;
pub mod blocks;
pub mod math;
pub mod order;
pub mod ray;
