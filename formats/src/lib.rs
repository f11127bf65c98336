//! Converts bytes to particles and back: readers for the formats of simulations, the native frame file, and the
//! sequences of files that make animations.
//!
//! ```text
//! files -> compression, readers, hdf5, native frames -> [formats] -> Sequence -> frames: ParticleFrame
//! ```
//!
//! `formats` turns bytes into frames and knows no rays. `jobs` plans, records and resumes work and
//! does not know what the work is. `spherule` (accelerators, tracer, output, command line) joins
//! them. Arrows never point the other way.
//!
//! This example opens a text file as a sequence, reads its particles, and writes them to a native frame:
//!
//! ```
//! use glam::DVec3;
//! use spherule_formats::{
//!     FrameFile, ParticleFrame, Sequence, SequenceInput, choose_origin, native,
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let dir = tempfile::tempdir()?;
//! let table = dir.path().join("drop.0042.csv");
//! std::fs::write(&table, "x,y,z,density\n0,0,1,998\n0,1,1,1001\n1,1,1,1004\n")?;
//!
//! // The files of a directory, of a pattern such as drop.####.csv, or of a list
//! let sequence = Sequence::open(&SequenceInput::from_path(dir.path()))?;
//! assert_eq!(sequence.frames()[0].number, 42);
//!
//! // One file, whose format is told by its content
//! let particles = FrameFile::open(&table)?.read(0)?;
//! assert_eq!(particles.positions.len(), 3);
//! assert_eq!(particles.attributes[0].name, "density");
//!
//! // Positions relative to an origin, which a sequence has in common
//! let origin = choose_origin(DVec3::ZERO, DVec3::ONE);
//! let frame = ParticleFrame::from_raw(particles, origin);
//! native::write(&dir.path().join("drop.0042.spf"), &frame, None)?;
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

pub mod convert;
pub mod detect;
pub mod native;
pub mod open;
pub mod registry;
pub mod sequence;
pub mod stats;
pub mod write;

pub use open::FrameFile;
pub use sequence::{Sequence, SequenceError, SequenceFrame, SequenceInput, SequenceSettings};
pub use spherule_files::{ValueError, escape_controls, is_control};
pub use spherule_frame::{
    Attribute, AttributeData, Bond, BondLengths, Endian, FARTHEST, FrameError, Labels, Lattice,
    MemoryBudget, ParseError, ParticleFrame, PeriodicImages, PositionSlice, Positions, Radius,
    RawParticles, ScalarType, SimulationCell, choose_origin, find_radius, generate, is_near,
    is_radius, join, names, sample_indices, with_values,
};
#[cfg(feature = "hdf5")]
pub use spherule_hdf5 as hdf5;
pub use spherule_readers::read::{element_symbol, name_code};
pub use spherule_readers::{Format, ValueNames, mesh, read};
pub use spherule_tree::{blocks, order};
