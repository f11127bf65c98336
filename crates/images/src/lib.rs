//! Pictures in and out of files.
//!
//! ```text
//! Film of tracer -> [images] -> OpenEXR, PNG, movies, sheets
//! ```
//!
//! - [`file`](mod@file): which format an image file has, and what may be wrong with it.
//! - [`hdr`]: images as input, in linear values: environments and pictures on the ground.
//! - [`picture`]: finished pictures as input: rows of 8 bits, planes of OpenEXR, scaling.
//! - [`overlay`]: colour bars, text, scale bars and axes over a finished picture.
//! - [`output`]: encodes a film of `spherule-tracer` as OpenEXR, PNG, JPEG, TIFF, PDF and SVG, and verifies such files.
//! - [`movie`]: movies and contact sheets of listed files.
//!
//! Bytes from elsewhere are not trusted: damaged pictures are errors that name the file. The same film gives the same
//! bytes. This crate knows no particles, manifests or jobs.
//!
//! This example writes a picture of two pixels as a PNG file and reads it:
//!
//! ```
//! use spherule_images::output::view::DisplayView;
//! use spherule_images::picture::{MARKER, Picture};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let directory = tempfile::tempdir()?;
//! # let path = directory.path().join("two.png");
//! let two = Picture::new(2, 1, vec![255, 0, 0, 0, 0, 255]);
//! spherule_files::publish(&path, &two.png(MARKER)?)?;
//! assert_eq!(Picture::read(&path, DisplayView::default())?.pixels(), [[255, 0, 0], [0, 0, 255]]);
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

use spherule_tracer::{render, scene};
use spherule_tree::math;

pub mod file;
pub mod hdr;
#[cfg(feature = "movies")]
pub mod movie;
pub mod output;
pub mod overlay;
pub mod picture;
