//! The thesis's experiment (chapter 5) on any count of any particles: build, then look from a
//! camera that moves, and say how fast and in how much memory.
//!
//! The unit is a *cell*: one particle count, one structure, one motion, one representation. What is
//! asked of a cell is a [`CellRequest`], what comes out is in `scale::report`. A cell measures the
//! memory of its whole process, so whoever wants several runs each in a process of its own, and so is
//! the native frame made that some are traced from; that, and all printing, is left to the caller.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use spherule_formats::native::Encoding;

use crate::accel::Structure;

pub mod cell;
pub mod convert;
mod measure;
mod motion;
mod particles;
mod peaks;
pub mod report;
mod stage;
mod stored;

pub use motion::Motion;
pub use particles::{FrameSurvey, Particles};
pub use stage::{Lighting, Stage};

/// What is asked of one cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellRequest {
    /// Where particles come from.
    pub source: Source,
    /// How many.
    pub particles: usize,
    /// Seed of the box, or of the choice among a frame's particles.
    pub seed: u64,
    /// Who builds.
    #[serde(with = "by_name")]
    pub structure: Structure,
    /// How the camera moves.
    pub motion: Motion,
    /// How positions are held.
    pub representation: Representation,
    /// What the camera moves around.
    pub stage: Stage,
    /// When it is enough.
    pub budget: Budget,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Levels of recursion, the primary ray's included.
    pub max_depth: u32,
    /// Threads to use.
    pub threads: usize,
}

/// Where particles come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The thesis's box, filled evenly; spheres of half the mean spacing.
    Box,
    /// A frame of the user's.
    Frame(FrameSource),
}

/// A frame of the user's, and what a look at it has settled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameSource {
    /// A file, pattern or directory.
    pub path: PathBuf,
    /// Number of the frame in it.
    pub frame: i64,
    /// World position that coordinates are relative to.
    pub origin: DVec3,
    /// Radius of all particles where the frame does not bring radii, world units.
    pub radius: f32,
    /// Radii under this are raised to it, world units.
    pub least_radius: f32,
}

/// When a cell has traced enough.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Budget {
    /// Once images have taken so many seconds.
    Seconds(f64),
    /// After so many images.
    Images(u32),
}

/// How positions are held while rays are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Representation {
    /// In memory, three f32 a particle, in a tree that is built there.
    Memory,
    /// In a native frame of f32, mapped and traced where it lies.
    F32,
    /// The same with 16 bits an axis.
    Q16,
    /// The same with 11, 11 and 10 bits.
    Q10,
}

impl Representation {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Memory, Self::F32, Self::Q16, Self::Q10];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Memory => "memory",
            Self::F32 => "f32",
            Self::Q16 => "q16",
            Self::Q10 => "q10",
        }
    }

    /// That of the native frame; None in memory.
    pub const fn encoding(self) -> Option<Encoding> {
        match self {
            Self::Memory => None,
            Self::F32 => Some(Encoding::F32),
            Self::Q16 => Some(Encoding::Q16),
            Self::Q10 => Some(Encoding::Q10),
        }
    }

    /// Whether there are cells of both. Every structure is built in memory; a native frame lies in k-d
    /// order and is no other tree than that where it lies.
    pub fn goes_with(self, structure: Structure) -> bool {
        self == Self::Memory || structure == Structure::Kdtree
    }

    /// Where positions are, for people.
    pub const fn place(self) -> &'static str {
        match self {
            Self::Memory => "in memory",
            Self::F32 => "in an f32 file",
            Self::Q16 => "in a q16 file",
            Self::Q10 => "in a q10 file",
        }
    }
}

/// What a process of its own is asked to do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Task {
    /// Make the native frame that cells like this one are traced from ([`convert::convert`]).
    Convert {
        /// One of them.
        request: CellRequest,
        /// Where to.
        path: PathBuf,
    },
    /// Measure a cell ([`cell::measure`]).
    Measure {
        /// Which.
        request: CellRequest,
        /// Its native frame, where it has one.
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

/// Values that print as their name and are read from it.
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
