//! CPU time of a thread.

use std::fs;
use std::thread;
use std::time::Instant;

/// What this thread has run so far; the time of day where the system does not measure it.
pub(crate) struct CpuTime {
    nanoseconds: Option<u64>,
    instant: Instant,
}

impl CpuTime {
    pub(crate) fn now() -> Self {
        // The kernel updates its statistics when a thread yields.
        thread::yield_now();
        let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
        Self {
            nanoseconds: text.split_whitespace().next().and_then(|n| n.parse().ok()),
            instant: Instant::now(),
        }
    }

    /// Seconds that this thread has run since then.
    pub(crate) fn seconds(&self) -> f64 {
        let now = Self::now();
        match (self.nanoseconds, now.nanoseconds) {
            (Some(before), Some(after)) => 1e-9 * (after - before) as f64,
            _ => self.instant.elapsed().as_secs_f64(),
        }
    }
}
