//! Readers of the file formats of particle simulations: bytes to particles.
//!
//! ```text
//! bytes of a file -> [readers] -> RawParticles -> formats: sequences of frames
//! ```
//!
//! - [`read`]: one file or directory for each format, with a constant `FORMAT` each.
//! - [`Reader`]: the interface that they implement; [`Format`] is a reader as a value.
//! - [`mesh`]: triangle meshes, for tanks and obstacles.
//! - [`compression`]: gzip, zstd, xz, bzip2, LZ4, blosc and archives with one member; a crate of its own.
//!
//! Readers trust nothing: they check every count against the bytes that are there, or against a
//! [`MemoryBudget`](spherule_frame::MemoryBudget), before they allocate. They do not know which other formats exist:
//! `spherule-formats` has the list, detection, sequences and native frames. See
//! `docs/manual/adding-an-input-format.md`.
//!
//! ```
//! use spherule_readers::read::csv;
//!
//! let text = b"x,y,z,density\n0,0,1,998\n0,1,1,1001\n";
//! let steps = csv::FORMAT.steps(text)?;
//! let particles = csv::FORMAT.read(text, &steps[0])?;
//! assert_eq!(particles.positions.len(), 2);
//! assert_eq!(particles.attributes[0].name, "density");
//! # Ok::<(), spherule_frame::ParseError>(())
//! ```
#![deny(unsafe_code)]

mod format;
pub mod hdf5_signature;
pub mod mesh;
pub mod ranges;
pub mod read;
mod reader;
pub mod shared;
mod step;

pub use format::Format;
pub use reader::*;
pub use spherule_compression as compression;
pub use spherule_compression::{decompressor, read_whole, regular};
pub use step::Step;
