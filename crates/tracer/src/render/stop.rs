//! Stop requests for a render in progress.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A stop request, which also receives the progress of a picture. All threads check it often, so the check must be cheap;
/// once raised, it must stay raised.
pub trait Stop: Sync {
    /// Whether to stop.
    fn is_raised(&self) -> bool;

    /// Called when so many more pixels are traced, by any thread.
    fn pixels_done(&self, _count: u32) {}
}

impl Stop for AtomicBool {
    fn is_raised(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}

/// A stop request at a point in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline(pub Instant);

impl Stop for Deadline {
    fn is_raised(&self) -> bool {
        Instant::now() >= self.0
    }
}
