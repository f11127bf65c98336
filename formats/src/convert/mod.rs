//! Frames of any size become native frames.

mod foreign;
mod source;

pub use foreign::open_source;
pub use source::{ParticleSource, SourceAttribute};
