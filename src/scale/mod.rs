//! The thesis's experiment (chapter 5) on any count of any particles: build, then look from a
//! camera that moves, and say how fast and in how much memory.
//!
//! The unit is a *cell*: one particle count, one structure, one motion, one representation. What is
//! asked of a cell is a [`CellRequest`], what comes out is in `report::scale`. A cell measures the
//! memory of its whole process, so whoever wants several runs each in a process of its own; that,
//! and all printing, is left to the caller.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::accel::Structure;

pub mod cell;
mod motion;
mod particles;
mod peaks;
mod stage;

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

/// How positions are held in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Representation {
    /// Three f32 a particle.
    F32,
}

impl Representation {
    /// All there are.
    pub const ALL: [Self; 1] = [Self::F32];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
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
