//! The experiment of the thesis (chapter 5) for any number of any particles: builds a tree, traces images from a
//! moving camera, and measures time and memory.
//!
//! ```text
//! particles -> tree or gpu -> [scale] -> time and memory of each structure -> report
//! ```
//!
//! The unit is a *cell*: one particle count, one structure, one motion, one representation. A [`CellRequest`]
//! describes a cell, [`cell::measure`] measures it, and [`report`] has its result and the tables, files and pages of
//! many. A cell measures the memory of its whole process, so callers should run each cell in a separate process, and also
//! make native frames for cells in place ([`convert::convert`]) in a separate process.
//!
//! Arguments, processes and printing are left to the caller, which is `spherule scale`.
//!
//! ```
//! use spherule_scale::{Budget, CellRequest, Motion, Representation, Source, Stage, cell};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let request = CellRequest {
//!     source: Source::Box,
//!     particles: 500,
//!     seed: 1,
//!     structure: "kdtree".parse()?,
//!     motion: Motion::Both,
//!     representation: Representation::Memory,
//!     stage: Stage::THESIS,
//!     budget: Budget::Images(2),
//!     width: 32,
//!     height: 18,
//!     samples: 1,
//!     max_depth: 3,
//!     threads: 1,
//! };
//! let measured = cell::measure(&request, None)?;
//! assert_eq!((measured.images, measured.rays.primary), (2, 2 * 32 * 18));
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use spherule_formats::native::Encoding;

use spherule_tree::accel::Structure;

pub mod cell;
pub mod convert;
mod error;
#[cfg(feature = "gpu")]
mod gpu;
mod measure;
mod motion;
mod particles;
mod peaks;
pub mod report;
mod stage;
mod stored;

pub use error::CellError;
pub use motion::Motion;
pub use particles::{FrameSurvey, Particles};
pub use stage::{Lighting, Stage};

/// The settings of one cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellRequest {
    /// Source of the particles.
    pub source: Source,
    /// Particle count.
    pub particles: usize,
    /// Seed of the box, or of the selection of particles of a frame.
    pub seed: u64,
    /// The structure to build.
    #[serde(with = "by_name")]
    pub structure: Structure,
    /// Motion of the camera.
    pub motion: Motion,
    /// Representation of positions.
    pub representation: Representation,
    /// Bounds, view and lights.
    pub stage: Stage,
    /// Time or number of images.
    pub budget: Budget,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Recursion depth, including the primary ray.
    pub max_depth: u32,
    /// Threads to use.
    pub threads: usize,
}

/// Source of particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The box of the thesis, evenly filled with spheres of half the mean spacing.
    Box,
    /// A frame of the user.
    Frame(FrameSource),
}

/// A frame of the user, with the results of its survey.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameSource {
    /// A file, pattern or directory.
    pub path: PathBuf,
    /// Number of the frame in it.
    pub frame: i64,
    /// World position that coordinates are relative to.
    pub origin: DVec3,
    /// Radius of all particles if the frame has no radii, world units.
    pub radius: f32,
    /// Minimum radius, to which smaller ones are raised, world units.
    pub least_radius: f32,
}

/// When a cell has traced enough images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Budget {
    /// After this time for images, in seconds.
    Seconds(f64),
    /// After this number of images.
    Images(u32),
}

/// Representation of positions during tracing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Representation {
    /// In memory, three f32 per particle, in a tree that is built there.
    Memory,
    /// In a native frame of f32 that is mapped and traced in place.
    F32,
    /// The same with 16 bits per axis.
    Q16,
    /// The same with 11, 11 and 10 bits.
    Q10,
    /// In the memory of a GPU, which builds a tree and traces it.
    Gpu,
}

impl Representation {
    /// All representations.
    pub const ALL: [Self; 5] = [Self::Memory, Self::F32, Self::Q16, Self::Q10, Self::Gpu];

    /// The name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Memory => "memory",
            Self::F32 => "f32",
            Self::Q16 => "q16",
            Self::Q10 => "q10",
            Self::Gpu => "gpu",
        }
    }

    /// The encoding of the native frame; None without one.
    pub const fn encoding(self) -> Option<Encoding> {
        match self {
            Self::Memory | Self::Gpu => None,
            Self::F32 => Some(Encoding::F32),
            Self::Q16 => Some(Encoding::Q16),
            Self::Q10 => Some(Encoding::Q10),
        }
    }

    /// Whether there are cells of this representation with `structure`. All structures can be built in memory; a
    /// native frame is in k-d order, so it is always the same tree in place, and a GPU builds trees along a curve.
    pub fn goes_with(self, structure: Structure) -> bool {
        match self {
            Self::Memory => true,
            Self::F32 | Self::Q16 | Self::Q10 => structure == Structure::Kdtree,
            Self::Gpu => structure == Structure::Lbvh,
        }
    }

    /// A description for messages.
    pub const fn place(self) -> &'static str {
        match self {
            Self::Memory => "in memory",
            Self::F32 => "in an f32 file",
            Self::Q16 => "in a q16 file",
            Self::Q10 => "in a q10 file",
            Self::Gpu => "on a GPU",
        }
    }
}

/// A task for a separate process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Task {
    /// Make the native frame for cells like this one ([`convert::convert`]).
    Convert {
        /// One of these cells.
        request: CellRequest,
        /// Path of the native frame.
        path: PathBuf,
    },
    /// Measure a cell ([`cell::measure`]).
    Measure {
        /// The cell.
        request: CellRequest,
        /// Its native frame, if it has one.
        file: Option<PathBuf>,
    },
}

impl Task {
    /// Threads to use.
    pub const fn threads(&self) -> usize {
        match self {
            Self::Convert { request, .. } | Self::Measure { request, .. } => request.threads,
        }
    }
}

impl fmt::Display for Representation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Serialises values as their names.
mod by_name {
    use super::{FromStr, fmt};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<T: fmt::Display, S: Serializer>(
        value: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(super) fn deserialize<'de, T, D>(deserializer: D) -> Result<T, D::Error>
    where
        T: FromStr<Err: fmt::Display>,
        D: Deserializer<'de>,
    {
        let name = String::deserialize(deserializer)?;
        name.parse().map_err(D::Error::custom)
    }
}
