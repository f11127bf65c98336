//! A job's frames as work for the engines that clusters and render farms have: texts that call one
//! program again and again, each time with other frames.
//!
//! Here is known what frames, chunks and a command line are; what the command does is the caller's.
//! Nothing is written to disk.

mod chunks;
pub mod openjd;
mod quote;
pub mod slurm;
mod time;
mod tree;

pub use chunks::{ChunkChoice, Chunks};
pub use time::TimeLimit;

/// Why there is no text for an engine.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// Something that the engine's text cannot hold.
    #[error("{what}: {text:?} {why}")]
    Text {
        /// What it is: `log directory`.
        what: &'static str,
        /// The text.
        text: String,
        /// What is wrong with it, and the remedy.
        why: String,
    },
    /// Settings that do not go together.
    #[error("{0}")]
    Settings(String),
    /// There is nothing to do.
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
