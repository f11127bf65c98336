//! Why there is no picture.

use spherule_formats::FrameError;

use crate::job::RunError;
use crate::manifest::ManifestError;
use crate::pipeline::ImageError;

/// Settings of a wish, more than a page has keys.
pub(super) const MAX_SETTINGS: usize = 1000;

/// Largest number of particles of a frame whose values are kept in memory beside the picture.
pub(super) const MAX_VALUES: usize = 20_000_000;

/// What a page shows in place of a picture, at the setting that it is about.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Fault {
    /// What is wrong.
    pub message: String,
    /// The dotted key that it is about, if it is about one.
    pub key: Option<String>,
}

/// Why a wish cannot be fulfilled.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    /// A setting is invalid, or does not go with the particles.
    #[error(transparent)]
    Job(#[from] RunError),
    /// The frame cannot be read or rendered.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The picture cannot be encoded.
    #[error(transparent)]
    Output(#[from] crate::output::OutputError),
    /// A value is none of a manifest.
    #[error("{}", .0.message)]
    Setting(Fault),
    /// The sequence has no such frame.
    #[error("frame {frame}: is not in the sequence")]
    NoFrame {
        /// Its number.
        frame: i64,
    },
    /// There are too many particles to have all of their values in memory beside the picture.
    #[error(
        "values of single particles are shown of up to {MAX_VALUES} particles; here are {particles}"
    )]
    TooLarge {
        /// Number of particles in the frame.
        particles: usize,
    },
    /// The picture on the page has only some of the particles.
    #[error(
        "render.memory_limit: not all particles fit into it, and a draft with some of them is not saved; raise the \
         limit"
    )]
    Draft,
    /// There are too many settings.
    #[error("more than {MAX_SETTINGS} settings")]
    TooMany,
}

impl From<ManifestError> for ExploreError {
    fn from(error: ManifestError) -> Self {
        Self::Job(RunError::Manifest(error))
    }
}

impl ExploreError {
    /// What a page shows.
    pub(super) fn fault(&self) -> Fault {
        let key = match self {
            Self::Setting(fault) => return fault.clone(),
            Self::Job(RunError::Manifest(error)) => error.key().map(str::to_owned),
            // Messages of settings begin with their keys
            _ => {
                let text = self.to_string();
                let first = text.split(':').next().unwrap_or_default();
                first.contains('.').then(|| first.to_owned())
            }
        };
        Fault { message: self.to_string(), key }
    }

    /// Whether a file needs more memory than it may.
    pub(super) const fn is_too_large(&self) -> bool {
        matches!(self, Self::Job(RunError::Frame(FrameError::TooLarge { .. })))
    }

    /// Whether rendering was stopped for a newer wish.
    pub(super) fn is_interrupted(&self) -> bool {
        use crate::pipeline::TraceError::Render;
        use crate::render::RenderError::Interrupted;
        matches!(self, Self::Image(ImageError::Trace(Render(Interrupted))))
    }
}
