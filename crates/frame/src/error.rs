//! Errors of frames, classified by what the caller can do next.
//!
//! Parsers work on bytes and report an offset ([`ParseError`]). The caller that opened the file adds the path
//! ([`FrameError`]).
//!
//! Messages may quote the file. The constructors therefore limit every message to one line of bounded length,
//! for all readers.

use std::io;
use std::path::{Path, PathBuf};

use spherule_files::one_line;

/// A fault in the bytes of a frame, without the path, which only the caller knows.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParseError {
    /// The bytes violate their format: truncated data, absurd counts, wrong tokens.
    #[error("byte {at}: {what}")]
    Malformed {
        /// Offset from the start of the uncompressed file.
        at: u64,
        /// The fact, then the remedy if there is one; lower case, no full stop.
        what: String,
    },
    /// A valid file of a kind that this version does not read.
    #[error("{what}")]
    Unsupported {
        /// The kind of file and the remedy.
        what: String,
    },
    /// Reading the file needs more memory than is allowed.
    #[error("{what}")]
    TooLarge {
        /// The limit and the remedy.
        what: String,
    },
}

impl ParseError {
    /// A [`ParseError::Malformed`] at byte `at`.
    pub fn malformed(at: usize, what: impl Into<String>) -> Self {
        Self::Malformed { at: at as u64, what: one_line(what.into()) }
    }

    /// A [`ParseError::Unsupported`].
    pub fn unsupported(what: impl Into<String>) -> Self {
        Self::Unsupported { what: one_line(what.into()) }
    }

    /// A [`ParseError::TooLarge`].
    pub fn too_large(what: impl Into<String>) -> Self {
        Self::TooLarge { what: one_line(what.into()) }
    }

    /// The same fault with its offset increased by `start`, the number of bytes before the parsed ones.
    #[must_use]
    pub fn behind(self, start: usize) -> Self {
        match self {
            Self::Malformed { at, what } => {
                Self::Malformed { at: at.saturating_add(start as u64), what }
            }
            other => other,
        }
    }

    /// The same fault at the same offset, with the message changed by `reword`.
    #[must_use]
    pub fn map_message(self, message: impl FnOnce(&str) -> String) -> Self {
        match self {
            Self::Malformed { at, what } => Self::Malformed { at, what: one_line(message(&what)) },
            Self::Unsupported { what } => Self::unsupported(message(&what)),
            Self::TooLarge { what } => Self::too_large(message(&what)),
        }
    }

    /// Adds the path of the file that the bytes came from.
    pub fn in_file(self, path: &Path) -> FrameError {
        let path = path.to_owned();
        match self {
            Self::Malformed { at, what } => FrameError::Malformed { path, at, what },
            Self::Unsupported { what } => FrameError::Unsupported { path, what },
            Self::TooLarge { what } => FrameError::TooLarge { path, what },
        }
    }
}

/// The reason why a frame could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// A malformed file: skip this frame and continue with the rest.
    #[error("{}: byte {at}: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Offset from the start of the uncompressed file.
        at: u64,
        /// The fact and the remedy.
        what: String,
    },
    /// A valid file that this version does not read.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The kind of file and the remedy.
        what: String,
    },
    /// Reading the file needs more memory than is allowed; a retry with more memory may work.
    #[error("{}: {what}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The limit and the remedy.
        what: String,
    },
    /// An error of the operating system; a retry may work.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
}

impl FrameError {
    /// An [`FrameError::Io`] for `path`.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_text_stays_on_its_line() {
        let name = "a\nb\u{1b}[2J";
        let errors = [
            ParseError::malformed(3, name),
            ParseError::unsupported(name),
            ParseError::unsupported("it").map_message(|it| format!("{name}: {it}")),
            ParseError::malformed(3, "it").map_message(|it| format!("{name}: {it}")),
        ];
        for error in errors {
            let text = error.to_string();
            assert!(text.contains(r"a\nb\u{1b}[2J"), "{text}");
            let path = Path::new("a.ply");
            assert_eq!(error.in_file(path).to_string(), format!("a.ply: {text}"));
        }
        let long = ParseError::malformed(0, "x".repeat(1 << 11));
        assert!(long.to_string().len() < 1000);
    }
}
