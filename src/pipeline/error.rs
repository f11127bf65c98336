//! Why a frame has no image.

use std::io;
use std::path::PathBuf;

use spherule_jobs::{FailureKind, FrameFailure, Panic};

use super::load_error::LoadError;
use super::memory_limit::MemoryLimitError;
use super::renderer::TraceError;
use crate::output::OutputError;
use crate::render::RenderError;

/// Why a frame has no image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// It needs more memory than the job may use.
    #[error(transparent)]
    Memory(#[from] MemoryLimitError),
    /// It cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// It cannot be traced.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// Its image cannot be encoded or written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A bug.
    #[error(transparent)]
    Panic(#[from] Panic),
}

/// Why an image cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// It cannot be encoded.
    #[error(transparent)]
    Encode(#[from] OutputError),
    /// It cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The image.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

impl ImageError {
    /// The failure of `frame` for this reason.
    pub fn into_failure(self, frame: i64) -> FrameFailure {
        let kind = match &self {
            Self::Trace(TraceError::Render(RenderError::Interrupted)) => FailureKind::Interrupted,
            Self::Panic(_) => FailureKind::Bug,
            _ => FailureKind::Frame,
        };
        match self {
            Self::Write(WriteError::Io { path, source }) => {
                FrameFailure::writing(frame, &path, source)
            }
            error => FrameFailure::new(kind, frame, error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_decides_what_the_run_does() {
        let write = |kind: io::ErrorKind| {
            ImageError::Write(WriteError::Io { path: PathBuf::from("f.exr"), source: kind.into() })
        };
        let interrupted = TraceError::Render(RenderError::Interrupted);
        let message = "index out of bounds".to_owned();
        for (error, kind) in [
            (write(io::ErrorKind::StorageFull), FailureKind::Output),
            (write(io::ErrorKind::FileTooLarge), FailureKind::Frame),
            (interrupted.into(), FailureKind::Interrupted),
            (Panic { message }.into(), FailureKind::Bug),
        ] {
            let text = error.to_string();
            assert_eq!(error.into_failure(3).kind, kind, "{text}");
        }
    }
}
