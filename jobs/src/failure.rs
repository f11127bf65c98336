//! Failures of single frames, divided by what the run does about them.

use std::error::Error;
use std::fmt;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::FileError;

/// What the run does after a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FailureKind {
    /// A bug in the program. Treated like [`FailureKind::Frame`].
    Bug,
    /// The process of the frame ended without a result. The failure is recorded, and the frame is retried if the
    /// run has retries left.
    Crash,
    /// An output cannot be written, and the same is expected of all further outputs. The run stops. The frame
    /// stays pending.
    Output,
    /// The frame was dropped because of an interrupt. The run stops. The frame stays pending.
    Interrupted,
    /// The frame cannot be processed, for example because its input is damaged. The failure is recorded, and the
    /// other frames continue. Unknown kinds in a ledger are read as this one.
    #[serde(other)]
    Frame,
}

impl FailureKind {
    /// Whether another attempt may succeed.
    pub const fn is_retryable(self) -> bool {
        matches!(self, Self::Crash)
    }

    /// Whether the run stops and the frame stays pending.
    pub const fn stops_run(self) -> bool {
        matches!(self, Self::Output | Self::Interrupted)
    }
}

/// Why a frame failed. It is displayed without the frame's number.
#[derive(Debug)]
pub struct FrameFailure {
    /// What the run does about it.
    pub kind: FailureKind,
    /// The frame.
    pub frame: i64,
    /// The error.
    pub source: Box<dyn Error + Send + Sync>,
}

impl FrameFailure {
    /// A failure with this kind and error.
    pub fn new(
        kind: FailureKind,
        frame: i64,
        source: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Self {
        Self { kind, frame, source: source.into() }
    }

    /// The failure to write the output at `path`. Its kind depends on the error: a full disk stops the run, an
    /// error that concerns this file alone does not.
    pub fn writing(frame: i64, path: &Path, source: io::Error) -> Self {
        let kind =
            if is_output_unavailable(&source) { FailureKind::Output } else { FailureKind::Frame };
        Self::new(kind, frame, FileError::new(path, "writing", source))
    }
}

impl fmt::Display for FrameFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.source.fmt(f)
    }
}

impl Error for FrameFailure {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        // The error itself is displayed already
        self.source.source()
    }
}

/// Whether all further outputs would fail for the same reason: the disk is full, or the directory is not writable
/// or does not exist any more.
fn is_output_unavailable(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull
            | io::ErrorKind::QuotaExceeded
            | io::ErrorKind::PermissionDenied
            | io::ErrorKind::ReadOnlyFilesystem
            | io::ErrorKind::NotFound
            | io::ErrorKind::StaleNetworkFileHandle
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_a_write_error_decides_whether_the_run_stops() {
        for (kind, stops) in [
            (io::ErrorKind::StorageFull, true),
            (io::ErrorKind::NotFound, true),
            (io::ErrorKind::FileTooLarge, false),
        ] {
            let failure = FrameFailure::writing(7, Path::new("f.exr"), kind.into());
            assert_eq!(failure.kind.stops_run(), stops, "{kind}");
            assert!(failure.to_string().starts_with("f.exr: "), "{failure}");
        }
    }

    #[test]
    fn kinds_of_later_versions_are_read() {
        let read = |text| serde_json::from_str::<FailureKind>(text).unwrap();
        assert_eq!(read("\"crash\""), FailureKind::Crash);
        assert_eq!(read("\"supernova\""), FailureKind::Frame);
    }
}
