//! What can go wrong with a frame, by what the caller can do next.
//!
//! Parsers work on bytes and report an offset ([`ParseError`]); the edge that opened the file adds
//! the path ([`FrameError`]).

use std::io;
use std::path::{Path, PathBuf};

/// A fault in the bytes of a frame, without the path that only the opener knows.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParseError {
    /// The bytes break their own format: truncated, absurd counts, wrong tokens.
    #[error("byte {at}: {what}")]
    Malformed {
        /// Offset from the start of the uncompressed file.
        at: u64,
        /// The fact, then the remedy if there is one; lower case, no full stop.
        what: String,
    },
    /// A valid file of a kind this version does not read.
    #[error("{what}")]
    Unsupported {
        /// What it is and what to do instead.
        what: String,
    },
}

impl ParseError {
    /// A [`ParseError::Malformed`] at byte `at`.
    pub fn malformed(at: usize, what: impl Into<String>) -> Self {
        Self::Malformed {
            at: at as u64,
            what: what.into(),
        }
    }

    /// A [`ParseError::Unsupported`].
    pub fn unsupported(what: impl Into<String>) -> Self {
        Self::Unsupported { what: what.into() }
    }

    /// Adds the path of the file that the bytes came from.
    pub fn in_file(self, path: &Path) -> FrameError {
        let path = path.to_owned();
        match self {
            Self::Malformed { at, what } => FrameError::Malformed { path, at, what },
            Self::Unsupported { what } => FrameError::Unsupported { path, what },
        }
    }
}

/// Why a frame could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// Skip this frame, carry on with the rest.
    #[error("{}: byte {at}: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Offset from the start of the uncompressed file.
        at: u64,
        /// The fact and the remedy.
        what: String,
    },
    /// Valid, but not for this version.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it is and what to do instead.
        what: String,
    },
    /// The operating system refused; perhaps worth a retry.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

impl FrameError {
    /// An [`FrameError::Io`] for `path`.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            source,
        }
    }
}
