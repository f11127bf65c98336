//! The clock by which workers judge each other. Tests advance it by hand.

use std::thread;
use std::time::{Duration, Instant};

#[cfg(test)]
use std::sync::{Arc, Mutex, PoisonError};

/// A monotonic clock.
#[derive(Debug, Clone)]
pub(crate) enum Clock {
    /// The clock of this machine.
    System,
    /// A clock that only advances when it is messages to, or by the time that somebody sleeps.
    #[cfg(test)]
    Manual(Arc<Mutex<Instant>>),
}

impl Clock {
    /// The current time.
    pub(crate) fn now(&self) -> Instant {
        match self {
            Self::System => Instant::now(),
            #[cfg(test)]
            Self::Manual(now) => *now.lock().unwrap_or_else(PoisonError::into_inner),
        }
    }

    /// Blocks for `time`.
    pub(crate) fn sleep(&self, time: Duration) {
        match self {
            Self::System => thread::sleep(time),
            #[cfg(test)]
            Self::Manual(now) => *now.lock().unwrap_or_else(PoisonError::into_inner) += time,
        }
    }

    /// A clock that stands still.
    #[cfg(test)]
    pub(crate) fn manual() -> Self {
        Self::Manual(Arc::new(Mutex::new(Instant::now())))
    }
}
