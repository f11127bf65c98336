//! Settings, report and errors of a conversion.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::FrameError;
use crate::native::{Bound, Encoding, FrameIndex};

/// How a source becomes a frame.
#[derive(Debug, Clone)]
pub struct ConvertSettings {
    /// How positions are stored; `None` takes what needs the fewest bytes within the bound. Of a frame that is
    /// ordered part by part, the first part decides.
    pub encoding: Option<Encoding>,
    /// How far stored positions may be from those of the source, and radii likewise.
    pub bound: Bound,
    /// World position of the zero of the stored positions.
    pub origin: DVec3,
    /// Whether y points up in the program that made the particles, so that viewers need no option for it.
    pub is_y_up: bool,
    /// Whose radii.
    pub radius: RadiusRule,
    /// Memory that the conversion may hold, bytes; less than [`Self::LEAST_MEMORY`] is taken as that. What a
    /// source holds itself is not counted, nor are the pages of files.
    pub memory: u64,
    /// How attributes are stored that are not named in `attributes`.
    pub other_attributes: AttributeChoice,
    /// How these attributes are stored. Names are those of the source, exactly.
    pub attributes: Vec<(String, AttributeChoice)>,
    /// Whether each particle's index in the source is kept, as an attribute `id` where there is none.
    pub keep_ids: bool,
    /// The directory of the nameless scratch file for what does not fit into memory; `None` is the directory of the
    /// frame.
    pub scratch_dir: Option<PathBuf>,
}

impl ConvertSettings {
    /// Default memory.
    pub const USUAL_MEMORY: u64 = 2 << 30;
    /// What the smallest conversion may hold.
    pub const LEAST_MEMORY: u64 = 64 << 20;
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
            scratch_dir: None,
        }
    }
}

/// Which radii a frame gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RadiusRule {
    /// This one for all particles, whatever the source has.
    All(f32),
    /// Those of the source: an attribute named `radius`, `pscale` or half a `diameter`, else one for all.
    Source {
        /// For all particles if the source has none.
        otherwise: Option<f32>,
    },
}

/// How an attribute is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AttributeChoice {
    /// In the type of the source.
    #[default]
    AsIs,
    /// In single precision.
    Single,
    /// In half precision: 11 bits, up to 65504.
    Half,
    /// In 8 bits over the range of the frame, each component in its own.
    Ranged,
    /// Not at all.
    LeaveOut,
}

/// A stretch of a conversion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Everything is read once: counts, ranges, a sample.
    Survey,
    /// Everything is read again and brought into its part.
    Divide,
    /// Parts are ordered, coded and written.
    Order,
    /// The file is completed and waits for the disk.
    Finish,
}

impl Phase {
    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survey => "survey",
            Self::Divide => "divide",
            Self::Order => "order",
            Self::Finish => "finish",
        }
    }
}

/// Receives the progress of a conversion and may cancel it. Called from many threads, several times a second at least.
pub trait Progress: Sync {
    /// `done` of `total` particles have passed `phase`. Breaking ends the conversion with
    /// [`ConvertError::Interrupted`].
    fn advanced(&self, phase: Phase, done: u64, total: u64) -> ControlFlow<()>;
}

/// Nobody looks.
impl Progress for () {
    fn advanced(&self, _phase: Phase, _done: u64, _total: u64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Why there is no frame. No file is left over then, and what was at the path still is.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The source, the frame or the scratch file, whichever the path names.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The particles cannot be stored with these settings.
    #[error("{}: {what}", path.display())]
    Refused {
        /// The frame that was to be written.
        path: PathBuf,
        /// The fact and the remedy.
        what: String,
    },
    /// Whoever looked on wanted it to end.
    #[error("interrupted")]
    Interrupted,
}

impl ConvertError {
    pub(super) fn refused(path: &Path, what: impl Into<String>) -> Self {
        Self::Refused {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}

/// What came of a conversion.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvertReport {
    /// What the frame holds.
    pub index: FrameIndex,
    /// Seconds of each phase, in order; one that was not needed is not there.
    pub seconds: Vec<(Phase, f64)>,
    /// Most bytes that records and the buffers to order them took at a time.
    pub peak_bytes: u64,
    /// Bytes that were put aside on disk.
    pub spilled_bytes: u64,
    /// Parts that the frame was ordered in.
    pub parts: usize,
}
