//! Being asked to stop: the first time, the frame in hand is finished; the second time, it is
//! dropped. Only the flag lives here; who hears the signals sets it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// How urgently to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InterruptLevel {
    /// Nobody asked.
    Run,
    /// Finish the frames in hand, start no other.
    FinishFrame,
    /// Drop the frames in hand.
    StopNow,
}

/// A flag that clones share. Raising it is one atomic operation, so a signal handler may do it.
#[derive(Debug, Clone, Default)]
pub struct Interrupt {
    asked: Arc<AtomicU8>,
}

impl Interrupt {
    /// A flag nobody has raised.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks once more.
    pub fn raise(&self) {
        let _ = self
            .asked
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, |n| n.checked_add(1));
    }

    /// What has been asked so far.
    pub fn level(&self) -> InterruptLevel {
        match self.asked.load(Ordering::Acquire) {
            0 => InterruptLevel::Run,
            1 => InterruptLevel::FinishFrame,
            _ => InterruptLevel::StopNow,
        }
    }

    /// Whether to start no further frame.
    pub fn is_raised(&self) -> bool {
        self.level() >= InterruptLevel::FinishFrame
    }

    /// Whether to drop the frames in hand.
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
