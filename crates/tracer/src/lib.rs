//! Renders scenes of particles to the planes of a film.
//!
//! - [`scene`]: camera, lights, environment, materials, background, ground: plain values.
//! - [`surface`]: shapes that rays intersect: spheres, their union, the isosurface of their field, meshes, rods.
//! - [`render`]: the Whitted and the path integrator, samplers, BSDFs, lights, and the [`render::Film`].
//! - [`denoise`]: removes noise from a picture and its features.
//!
//! Pictures do not depend on threads, tile order or instruction set. This crate takes slices and returns values: it
//! opens no files and prints nothing. ARCHITECTURE.md describes the render core and how to extend it.
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use glam::Vec3;
//! use spherule_tracer::render::{RenderSettings, render};
//! use spherule_tracer::scene::Ground;
//!
//! // The exit of a cube is where it is: settings are plain values with defaults
//! let settings = RenderSettings { width: 64, height: 36, ..RenderSettings::default() };
//! assert_eq!(settings.width * settings.height, 2304);
//! # let _ = (render, Ground::at_height, AtomicBool::new(false), Vec3::ZERO);
//! ```
#![deny(unsafe_code)]

pub mod denoise;
pub mod render;
pub mod scene;
pub mod surface;
