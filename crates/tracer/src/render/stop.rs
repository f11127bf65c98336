//! Stop requests for a render in progress.

use std::sync::atomic::{AtomicBool, Ordering};

/// A stop request, which also receives the progress of a picture. All threads check it often, so the check must be cheap;
/// once raised, it must stay raised.
pub trait Stop: Sync {
    /// Whether to stop.
    fn is_raised(&self) -> bool;

    /// Called before the first pixel, after what the whole picture needs: photons, and maps of the light on the ground.
    fn pixels_begin(&self) {}

    /// Called when so many more pixels are traced, by any thread.
    fn pixels_done(&self, _count: u32) {}
}

impl Stop for AtomicBool {
    fn is_raised(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}
