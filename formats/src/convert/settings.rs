//! Settings, report and errors of a conversion.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::FrameError;
use crate::native::{Bound, Encoding, FrameIndex};

/// How to convert a source to a frame.
#[derive(Debug, Clone)]
pub struct ConvertSettings {
    /// How positions are stored; `None` chooses the encoding that needs the fewest bytes within the bound. If a
    /// frame is ordered in parts, the first part decides.
    pub encoding: Option<Encoding>,
    /// Largest distance of stored positions from those of the source, and largest difference of stored radii.
    pub bound: Bound,
    /// World position that stored positions are relative to.
    pub origin: DVec3,
    /// Whether y points up in the program that made the particles, so that viewers need no option for it.
    pub is_y_up: bool,
    /// The radii that the frame gets.
    pub radius: RadiusRule,
    /// Memory that the conversion may hold, bytes; at least [`Self::MIN_MEMORY`] is used. The memory of the
    /// source itself is not counted, nor are the pages of mapped files.
    pub memory: u64,
    /// How to store attributes that `attributes` does not name.
    pub other_attributes: AttributeChoice,
    /// How to store these attributes. The names must match those of the source exactly.
    pub attributes: Vec<(String, AttributeChoice)>,
    /// Whether to store each particle's index in the source, as an attribute `id` if the source has none.
    pub keep_ids: bool,
    /// Simulation time of the frame; `None` takes that of the source.
    pub time: Option<f64>,
    /// The directory of the unnamed scratch file for data that does not fit into memory; `None` is the
    /// directory of the frame.
    pub scratch_dir: Option<PathBuf>,
}

impl ConvertSettings {
    /// Default memory limit, bytes.
    pub const USUAL_MEMORY: u64 = 2 << 30;
    /// Smallest memory limit, bytes.
    pub const MIN_MEMORY: u64 = 64 << 20;
}

impl Default for ConvertSettings {
    fn default() -> Self {
        Self {
            encoding: Some(Encoding::F32),
            bound: Bound::None,
            origin: DVec3::ZERO,
            is_y_up: false,
            radius: RadiusRule::Source { otherwise: None },
            memory: Self::USUAL_MEMORY,
            other_attributes: AttributeChoice::AsIs,
            attributes: Vec::new(),
            keep_ids: false,
            time: None,
            scratch_dir: None,
        }
    }
}

/// Which radii a frame gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusRule {
    /// This radius for all particles, whatever the source has.
    All(f32),
    /// The radii of the source: an attribute named `radius` or `pscale`, or half of a `diameter`; otherwise one
    /// radius for all particles.
    Source {
        /// The radius of all particles if the source has none.
        otherwise: Option<f32>,
    },
}

/// How an attribute is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AttributeChoice {
    /// The attribute is stored in the type of the source.
    #[default]
    AsIs,
    /// The attribute is stored in single precision.
    Single,
    /// The attribute is stored in half precision: 11 bits, up to 65504.
    Half,
    /// The attribute is stored in 8 bits over the range of the frame; each component has its own range.
    Ranged,
    /// The attribute is not stored.
    LeaveOut,
}

/// A phase of a conversion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Reads everything once: counts, ranges and a sample.
    Survey,
    /// Reads everything again and brings each particle into its part.
    Divide,
    /// Orders, encodes and writes the parts.
    Order,
    /// Completes the file and waits for the disk.
    Finish,
}

impl Phase {
    /// The name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survey => "survey",
            Self::Divide => "divide",
            Self::Order => "order",
            Self::Finish => "finish",
        }
    }
}

/// Receives the progress of a conversion and may cancel it. Many threads call it, at least several times a second.
pub trait Progress: Sync {
    /// `done` of `total` particles have passed `phase`. Returning `Break` cancels the conversion with
    /// [`ConvertError::Interrupted`].
    fn advanced(&self, phase: Phase, done: u64, total: u64) -> ControlFlow<()>;
}

/// Ignores the progress.
impl Progress for () {
    fn advanced(&self, _phase: Phase, _done: u64, _total: u64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Why a conversion failed. No file is left behind, and an earlier file at the path is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The source, the frame or the scratch file failed; the path names it.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The particles cannot be stored with these settings.
    #[error("{}: {what}", path.display())]
    Refused {
        /// The frame that was not written.
        path: PathBuf,
        /// The fact and the remedy.
        what: String,
    },
    /// The progress callback cancelled the conversion.
    #[error("interrupted")]
    Interrupted,
}

impl ConvertError {
    pub(super) fn refused(path: &Path, what: impl Into<String>) -> Self {
        Self::Refused { path: path.to_owned(), what: what.into() }
    }
}

/// The result of a conversion.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvertReport {
    /// The contents of the frame.
    pub index: FrameIndex,
    /// Seconds of each phase, in order; phases that were not needed are missing.
    pub seconds: Vec<(Phase, f64)>,
    /// Peak bytes of records and of the buffers to order them.
    pub peak_bytes: u64,
    /// Bytes that were spilled to disk.
    pub spilled_bytes: u64,
    /// Number of parts in which the frame was ordered.
    pub parts: usize,
}
