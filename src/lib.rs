//! Renders particle-simulation time steps by CPU ray tracing: acceleration structures, surfaces, shading, images, and
//! the pipeline and commands that connect them.
//!
//! `spherule-formats` turns bytes into frames and knows nothing about rays. `spherule-jobs` plans, records and resumes
//! work and does not know what the work is. This crate connects the two; neither depends on it.
//!
//! This example builds a tree over two spheres and traces one ray:
//!
//! ```
//! use glam::Vec3;
//! use spherule::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
//! use spherule::ray::Ray;
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
#![deny(unsafe_code)]

pub mod accel;
pub mod attributes;
#[cfg(feature = "cli")]
pub mod cli;
pub mod conversion;
pub mod denoise;
pub mod hdr;
pub mod job;
pub mod manifest;
pub mod math;
pub mod metrics;
#[cfg(feature = "movies")]
pub mod movie;
pub mod output;
pub mod overlay;
pub mod picture;
pub mod pipeline;
pub mod ray;
pub mod reading;
pub mod render;
pub mod report;
pub mod resolve;
#[cfg(feature = "reports")]
pub mod scale;
pub mod scene;
pub mod selection;
pub mod surface;
pub mod survey;
#[cfg(feature = "reports")]
pub mod viewer;
