//! Errors of commands.

use std::io;
use std::path::{Path, PathBuf};

use spherule_formats::FrameError;
use spherule_formats::sequence::SequenceError;
use spherule_jobs::JobError;

use crate::manifest::ManifestError;

#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    #[error(transparent)]
    Job(#[from] JobError),
    #[error("no frame can be read: {0}")]
    Frame(#[from] FrameError),
    #[error("{}: {}", path.display(), reason(source))]
    Io { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Other(String),
}

/// The message of the operating system, with a remedy if there is one.
fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "no space left; free some and run the same command again".to_owned()
        }
        _ => error.to_string(),
    }
}

impl CliError {
    pub(super) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    /// The messages, one per line.
    pub(super) fn messages(&self) -> Vec<String> {
        match self {
            Self::Manifest(error) => error.messages().to_vec(),
            other => vec![other.to_string()],
        }
    }

    pub(super) fn other(what: impl Into<String>) -> Self {
        Self::Other(what.into())
    }
}
