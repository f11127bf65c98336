//! Frames of any size become native frames.

mod source;

pub use source::{ParticleSource, SourceAttribute};
