//! Renders particle-simulation time steps by CPU ray tracing: acceleration structures, surfaces, shading, images, and
//! the pipeline and commands that connect them.
//!
//! `spherule-formats` turns bytes into frames and knows nothing about rays. `spherule-tracer` turns slices into images
//! and knows nothing about files. `spherule-jobs` plans, records and resumes work and does not know what the work is.
//! This crate connects them; none depends on it. Its modules [`accel`], [`math`] and [`ray`] are those of
//! `spherule-tree`, its modules [`scene`], [`render`] and [`denoise`] those of `spherule-tracer`, and [`hdr`],
//! [`output`], [`overlay`], [`picture`] and `movie` those of `spherule-images`. [`surface`], [`manifest`], [`survey`],
//! [`selection`], [`report`] and `scale` are the crates of these names.
//!
//! ```text
//! files of simulations                                                              pictures
//!        |                                                                              ^
//!        |  compression, readers, hdf5, formats                                         |  images, report
//!        v                                                                              |
//!   ParticleFrame ------> tree ------> surface ------> tracer or gpu ------> Film ------'
//!        ^   selection, survey            (spherule: defaults, pipeline, commands)
//!        |
//!   manifest: every setting        jobs: which frames are done        files, frame: used by all
//! ```
//!
//! This example renders positions in memory to planes, and to the bytes of an EXR and a PNG, without files:
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use spherule::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A cube of 1000 particles with one attribute
//! let at = |i: u16| Vec3::new(f32::from(i % 10), f32::from(i / 10 % 10), f32::from(i / 100));
//! let positions: Vec<Vec3> = (0..1000).map(at).collect();
//! let height: Vec<f32> = positions.iter().map(|p| p.z).collect();
//!
//! // Settings are those of a manifest; the rest is automatic
//! let settings = StillSettings::parse(
//!     r#"
//!     image = { width = 64, height = 36, samples = 4 }
//!     input.radius = 0.5
//!     material.color = { attribute = "height", map = "viridis" }
//!     output.channels = ["Z", "id"]
//!     "#,
//! )?;
//! let particles = Particles {
//!     attributes: vec![scalar("height", height)],
//!     ..particles(PositionSlice::F32(&positions))
//! };
//!
//! // Another thread may raise the flag to stop
//! let image = render(&settings, particles, &AtomicBool::new(false))?;
//!
//! let film: &Film = image.film();
//! let depth = film.plane::<f32>(FilmPlane::Depth).expect("requested");
//! assert!(film.color[32 + 18 * 64][3] > 0.9 && depth[32 + 18 * 64].is_finite());
//! assert_eq!(image.to_exr()?[..4], [0x76, 0x2f, 0x31, 0x01]);
//! assert_eq!(image.to_png()?[..4], *b"\x89PNG");
//! # Ok(())
//! # }
//! ```
//!
//! [`still`] has the details, [`job`] runs whole jobs, and [`accel`] has trees for other programs.
//!
//! # Versions
//!
//! The version numbers follow semantic versioning: before 1.0, a new minor version may change the interface, and a
//! patch version does not. The interface is what [`prelude`], [`still`], [`job`] and [`manifest`] export, and the
//! public items of `spherule-formats` and `spherule-jobs`. All other modules are public for programs that need them,
//! and may change with any version. Manifests, plans and native frames of earlier versions stay readable. The same
//! input gives the same bytes in all patch versions, and the changelog names every change of an image.
#![deny(unsafe_code)]

#[cfg(feature = "cli")]
pub mod cli;
pub mod conversion;
pub mod defaults;
#[cfg(feature = "explore")]
pub mod explore;
pub mod job;
pub mod pipeline;
pub mod prelude;
pub mod resolve;
pub mod still;

pub use spherule_frame::reading;
#[cfg(feature = "movies")]
pub use spherule_images::movie;
pub use spherule_images::{hdr, output, overlay, picture};
pub use spherule_manifest as manifest;
pub use spherule_report as report;
#[cfg(feature = "reports")]
pub use spherule_report::viewer;
#[cfg(feature = "reports")]
pub use spherule_scale as scale;
pub use spherule_selection as selection;
pub use spherule_surface as surface;
pub use spherule_survey as survey;
pub use spherule_tracer::{denoise, render, scene};
pub use spherule_tree::{accel, math, ray};
