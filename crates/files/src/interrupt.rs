//! Requests to stop: after the first, frames in progress are finished; after the second, they are dropped. The
//! signal handler is elsewhere; this module has only the flag.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// How urgently to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InterruptLevel {
    /// No request to stop.
    Run,
    /// Finish the frames in progress, start no other.
    FinishFrame,
    /// Drop the frames in progress.
    StopNow,
}

/// A flag that clones share. Raising it is one atomic operation, so it is safe in a signal handler.
#[derive(Debug, Clone, Default)]
pub struct Interrupt {
    requests: Arc<AtomicU8>,
}

impl Interrupt {
    /// A flag that is not raised.
    pub fn new() -> Self {
        Self::default()
    }

    /// Requests to stop; the second request is more urgent.
    pub fn raise(&self) {
        let _ =
            self.requests.fetch_update(Ordering::AcqRel, Ordering::Acquire, |n| n.checked_add(1));
    }

    /// The current level.
    pub fn level(&self) -> InterruptLevel {
        match self.requests.load(Ordering::Acquire) {
            0 => InterruptLevel::Run,
            1 => InterruptLevel::FinishFrame,
            _ => InterruptLevel::StopNow,
        }
    }

    /// Whether to start no further frame.
    pub fn is_raised(&self) -> bool {
        self.level() >= InterruptLevel::FinishFrame
    }

    /// Whether to drop the frames in progress.
    pub fn stop_now(&self) -> bool {
        self.level() == InterruptLevel::StopNow
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escalates_and_stays() {
        let flag = Interrupt::new();
        let seen = flag.clone();
        assert_eq!(seen.level(), InterruptLevel::Run);
        flag.raise();
        assert!(seen.is_raised() && !seen.stop_now());
        for _ in 0..300 {
            flag.raise();
        }
        assert!(seen.stop_now());
    }
}
