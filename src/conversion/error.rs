//! Why a frame, or a sequence, cannot be converted.

use spherule_formats::convert::ConvertError;
use spherule_formats::{FrameError, Sequence};
use spherule_jobs::{FailureKind, FrameFailure};

use super::ConvertTask;

/// Why a frame cannot be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConversionError {
    /// It cannot be read, stored or written.
    #[error(transparent)]
    Convert(ConvertError),
    /// The last frame of the sequence is damaged. The simulation may still be writing it.
    #[error(
        "{0}; this is the newest frame: if the simulation is still writing it, convert again later"
    )]
    Newest(ConvertError),
}

impl ConversionError {
    /// The error of frame `index` of `sequence`.
    pub(super) fn new(error: ConvertError, sequence: &Sequence, index: usize) -> Self {
        let is_newest = index + 1 == sequence.frames().len();
        match error {
            ConvertError::Frame(FrameError::Malformed { .. }) if is_newest => Self::Newest(error),
            _ => Self::Convert(error),
        }
    }

    /// The failure of `task` for this reason.
    pub(super) fn into_failure(self, task: &ConvertTask) -> FrameFailure {
        let output_dir = task.output.parent().unwrap_or(&task.output);
        match self {
            Self::Convert(ConvertError::Frame(FrameError::Io { path, source }))
                if path.starts_with(output_dir) =>
            {
                FrameFailure::writing(task.frame, &path, source)
            }
            _ => FrameFailure::new(FailureKind::Frame, task.frame, self),
        }
    }
}

/// The settings name an attribute that no frame has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no frame has `{name}`; there are {known}")]
pub struct UnknownAttribute {
    /// The name.
    pub name: String,
    /// The attributes of the sequence, as text.
    pub known: String,
}
