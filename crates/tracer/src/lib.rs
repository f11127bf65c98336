//! Renders scenes of particles to the planes of a film.
//!
//! ```text
//! shapes of surface, a Scene -> [tracer] -> Film -> images
//! ```
//!
//! - [`scene`]: camera, lights, environment, materials, background, ground: plain values.
//! - [`render`]: the Whitted and the path integrator, samplers, BSDFs, lights, and the [`render::Film`].
//! - [`denoise`]: removes noise from a picture and its features.
//!
//! The shapes that rays intersect are those of `spherule-surface`.
//!
//! Pictures do not depend on threads, tile order or instruction set. This crate takes slices and returns values: it
//! opens no files and prints nothing. ARCHITECTURE.md describes the render core and how to extend it.
//!
//! This example renders two spheres, one of them red:
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use glam::{DVec3, Vec3};
//! use spherule_tracer::render::{Colors, ParticleShading, RenderSettings, render};
//! use spherule_tracer::scene::{Camera, CameraView, Scene};
//! use spherule_surface::spheres::SphereSurface;
//! use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let centers = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0)];
//! let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(0.8) };
//! let mut builder = TreeBuilder::new();
//! builder.build(&spheres, &BuildSettings::default());
//! let surface = SphereSurface::new(builder.tree().view());
//!
//! let view = CameraView {
//!     eye: DVec3::new(0.0, -8.0, 0.0),
//!     look_at: DVec3::ZERO,
//!     up: DVec3::Z,
//!     fov: 30.0,
//! };
//! let scene = Scene::new(Camera::new(&view, 2.0, DVec3::ZERO)?);
//! let colors = [Vec3::new(0.8, 0.1, 0.1), Vec3::ONE];
//! let source =
//!     ParticleShading { colors: Colors::PerParticle(&colors), ..ParticleShading::constant(Vec3::ONE) };
//! // Another thread may raise the flag to stop
//! let stop = AtomicBool::new(false);
//! let (film, counts) =
//!     render(&[&surface], &scene, &source, &RenderSettings::new(64, 32), &stop)?;
//! let [red, green, _, alpha] = film.color[24 + 16 * 64];
//! assert!(red > 2.0 * green && alpha == 1.0);
//! assert_eq!(counts.primary, 64 * 32);
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

pub mod denoise;
pub mod render;
pub mod scene;
