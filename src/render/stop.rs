//! Asking a render to end before the image is whole.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Says whether to end. Looked at often and by all threads: the answer must be cheap, and stay yes.
pub trait Stop: Sync {
    /// Whether to end.
    fn is_raised(&self) -> bool;
}

impl Stop for AtomicBool {
    fn is_raised(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}

/// A time to end at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline(pub Instant);

impl Stop for Deadline {
    fn is_raised(&self) -> bool {
        Instant::now() >= self.0
    }
}
