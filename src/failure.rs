//! Failures that are not errors of the data: panics.

use std::panic::{self, AssertUnwindSafe};

/// A panic in the work of one frame. It is a bug in spherule and fails this frame only.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a bug in spherule, please report it: {message}")]
pub struct Panic {
    /// The message of the panic.
    pub message: String,
}

/// Runs the work of one frame, and returns a panic in it as an error.
pub(crate) fn catch_panic<T, E: From<Panic>>(work: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let message = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given");
        let message = message.to_owned();
        Err(Panic { message }.into())
    })
}
