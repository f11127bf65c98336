//! Panics as errors of a single frame.

use std::panic::{self, AssertUnwindSafe};

/// The work on a frame has panicked. This is a bug; it fails this frame only.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("internal error, please report it: {message}")]
pub struct Panic {
    /// The message of the panic.
    pub message: String,
}

/// Runs the work on a frame, and returns a panic in it as an error.
///
/// # Errors
/// Those of `work`, and [`Panic`].
pub fn catch_panic<T, E: From<Panic>>(work: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let message = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given")
            .to_owned();
        Err(Panic { message }.into())
    })
}
