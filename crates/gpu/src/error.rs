//! Reasons why a device cannot be used.

use thiserror::Error;

/// Errors of devices.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GpuError {
    /// No adapter at all.
    #[error("no GPU was found")]
    NoAdapter,
    /// The number of an adapter that does not exist.
    #[error("there is no GPU {index}: {count} found, counted from 0")]
    UnknownAdapter {
        /// The number.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The driver refused to open the adapter.
    #[error("{adapter}: {message}")]
    Open {
        /// Name of the adapter.
        adapter: String,
        /// The driver's reason.
        message: String,
    },
    /// The adapter lacks what the kernels need.
    #[error("{adapter}: {what} {found}, {needed} are needed")]
    Limit {
        /// Name of the adapter.
        adapter: String,
        /// What is limited.
        what: &'static str,
        /// What the adapter has.
        found: u64,
        /// What is needed.
        needed: u64,
    },
    /// The adapter computes something else than the CPU.
    #[error(
        "{adapter}: its arithmetic is inexact ({what}), so that pictures would differ from those of the CPU"
    )]
    SelfTest {
        /// Name of the adapter.
        adapter: String,
        /// The operation.
        what: &'static str,
    },
    /// More data than one array of the device holds.
    #[error("{what} need {bytes} bytes in one array, the GPU allows {max}")]
    TooLarge {
        /// The data.
        what: &'static str,
        /// Their size.
        bytes: u64,
        /// The largest array.
        max: u64,
    },
    /// The memory of the device is full.
    #[error("the memory of the GPU is full")]
    OutOfMemory,
    /// The device is gone: another program reset it, or the driver stopped a kernel that took too long.
    #[error("{adapter} was lost: {message}")]
    Lost {
        /// Name of the adapter.
        adapter: String,
        /// The driver's reason.
        message: String,
    },
    /// The driver reported another error.
    #[error("the GPU reported an error: {0}")]
    Driver(String),
    /// Rendering was stopped.
    #[error("interrupted")]
    Interrupted,
}
