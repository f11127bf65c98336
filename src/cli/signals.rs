//! TERM and Ctrl-C: the first asks the job to finish the frame in hand, the second stops at once.
//! Before there is a frame in hand, so does the first.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use spherule_jobs::Interrupt;

use super::{CliError, INTERRUPTED, events};

/// What is said to whoever sent a signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Words {
    /// After the first, with work in hand.
    pub(super) asked: &'static str,
    /// After the one that ends the process.
    pub(super) at_once: &'static str,
}

/// Whoever listens for signals.
pub(super) struct Listener {
    /// Raised by the first signal once there are frames in hand.
    interrupt: Interrupt,
    at_work: Arc<AtomicBool>,
}

impl Listener {
    /// From now on there are frames in hand.
    pub(super) fn at_work(&self) -> &Interrupt {
        self.at_work.store(true, Ordering::Release);
        &self.interrupt
    }
}

/// Listens until the process ends.
pub(super) fn listen(words: Words) -> Result<Listener, CliError> {
    let interrupt = Interrupt::new();
    let at_work = Arc::new(AtomicBool::new(false));
    let mut signals = Signals::new([SIGINT, SIGTERM])
        .map_err(|e| CliError::other(format!("cannot listen for signals: {e}")))?;
    let listener = Listener {
        interrupt: interrupt.clone(),
        at_work: Arc::clone(&at_work),
    };
    // Threads that begin after the survey find the memory that it has left, which is for the frames.
    spherule_jobs::start_heart();
    thread::spawn(move || {
        for _ in signals.forever() {
            if interrupt.is_raised() || !at_work.load(Ordering::Acquire) {
                // Nothing is lost: images appear whole or not at all, and what was being written
                // is cleared away by the next run.
                say!("{}", words.at_once);
                events::end_at_once(INTERRUPTED);
                std::process::exit(i32::from(INTERRUPTED));
            }
            interrupt.raise();
            say!("{}", words.asked);
        }
    });
    Ok(listener)
}
