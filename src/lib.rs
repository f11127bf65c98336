//! Renders particle-simulation time steps by CPU ray tracing: accelerators, surfaces, shading,
//! images, and the pipeline and commands that join them.
//!
//! `formats` turns bytes into frames and knows no rays. `jobs` plans, records and resumes work and
//! does not know what the work is. This crate joins them. Arrows never point the other way.
#![deny(unsafe_code)]

pub mod accel;
pub mod cli;
pub mod manifest;
pub mod output;
pub mod pipeline;
pub mod ray;
pub mod render;
pub mod report;
pub mod resolve;
pub mod scene;
pub mod surface;
pub mod survey;
