//! Exports the frames of a job to the schedulers of clusters and render farms: as a script or template that runs
//! one program repeatedly, each time with other frames.
//!
//! This module knows frames, chunks and command lines. It does not know what the command does, and it writes
//! nothing to disk.

mod chunks;
pub mod openjd;
mod quote;
pub mod slurm;
mod time;
mod tree;

pub use chunks::{ChunkChoice, Chunks};
pub use time::TimeLimit;

/// Why a job cannot be exported.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// A text that the script or template cannot contain.
    #[error("{what}: {text:?} {why}")]
    Text {
        /// Name of the value: `log directory`.
        what: &'static str,
        /// The text.
        text: String,
        /// Reason and remedy.
        why: String,
    },
    /// Inconsistent settings.
    #[error("{0}")]
    Settings(String),
    /// There are no frames.
    #[error("there are no frames to export")]
    NoFrames,
}

impl ExportError {
    fn text(what: &'static str, text: &str, why: impl Into<String>) -> Self {
        Self::Text {
            what,
            text: text.to_owned(),
            why: why.into(),
        }
    }
}
