//! Converts bytes to particles and back: readers for the formats of simulations, the native frame file, and the
//! sequences of files that make animations.
//!
//! `formats` turns bytes into frames and knows no rays. `jobs` plans, records and resumes work and
//! does not know what the work is. `spherule` (accelerators, tracer, output, command line) joins
//! them. Arrows never point the other way.
#![deny(unsafe_code)]

mod attribute;
mod budget;
mod cell;
mod compression;
mod decode;
mod error;
mod format;
mod frame;
mod images;
mod message;
mod origin;
mod ranges;
mod reader;
mod registry;
mod regular;
mod scalar;
mod shared;
mod step;
mod value_error;

pub mod blocks;
pub mod convert;
pub mod detect;
pub mod generate;
pub mod mesh;
pub mod names;
pub mod native;
pub mod open;
pub mod order;
pub mod read;
pub mod sequence;
pub mod stats;
pub mod write;

pub use attribute::{Attribute, AttributeData};
pub use budget::MemoryBudget;
pub use cell::SimulationCell;
pub use error::{FrameError, ParseError};
pub use frame::{
    FARTHEST, ParticleFrame, PositionSlice, Positions, Radius, RawParticles, find_radius, is_near,
    is_radius,
};
pub use images::PeriodicImages;
pub use message::{escape_controls, is_control};
pub use open::FrameFile;
pub use origin::choose_origin;
pub use read::element_symbol;
pub use scalar::{Endian, ScalarType};
pub use sequence::{Sequence, SequenceError, SequenceFrame, SequenceInput, SequenceSettings};
pub use value_error::ValueError;
