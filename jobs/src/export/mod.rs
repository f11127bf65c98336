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
pub use time::{TimeLimit, TimeLimitError};

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
    /// The signal would be sent too early, or not at all.
    #[error("the signal must be sent 1 to {max} seconds before the time limit, not {seconds}")]
    SignalAhead {
        /// The requested time, seconds.
        seconds: u32,
        /// The longest time that Slurm accepts, seconds.
        max: u32,
    },
    /// The signal would be sent before the task starts.
    #[error(
        "a time limit of {limit} leaves no time to work if the signal is sent {signal_ahead} s before it"
    )]
    NoTimeToWork {
        /// The time limit.
        limit: TimeLimit,
        /// Time between signal and limit, seconds.
        signal_ahead: u32,
    },
    /// The list of frames is too long for a template.
    #[error(
        "the frames have so many gaps that their list exceeds the {max} characters of a template value"
    )]
    TooManyGaps {
        /// The limit, characters.
        max: usize,
    },
    /// The template cannot be written as JSON.
    #[error("cannot serialise the template: {0}")]
    Serialize(String),
    /// There are no frames.
    #[error("there are no frames to export")]
    NoFrames,
}

impl ExportError {
    fn text(what: &'static str, text: &str, why: impl Into<String>) -> Self {
        Self::Text { what, text: text.to_owned(), why: why.into() }
    }
}
