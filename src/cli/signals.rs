//! TERM and Ctrl-C: the first asks the job to finish the frame in hand, for as long as the grace period lasts, the
//! second stops at once. Before there is a frame in hand, so does the first.
//!
//! When the grace period is over, tracing drops the frame. Stages that do not look at the interrupt (reading, tree
//! builders, encoders) get a moment more, then the process ends under them.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use spherule_jobs::{Interrupt, discard_own_parts};

use super::{CliError, INTERRUPTED, events};

/// Time after the grace period to record what was done and to write the reports.
const WIND_UP: Duration = Duration::from_secs(2);

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
    /// How long a frame in hand may take after the first signal; without it, as long as it takes.
    grace: Arc<OnceLock<Duration>>,
}

impl Listener {
    /// From now on there are frames in hand.
    pub(super) fn at_work(&self) -> &Interrupt {
        self.at_work.store(true, Ordering::Release);
        &self.interrupt
    }

    /// From now on there are frames in hand, which are dropped when they take longer than `grace` after the first
    /// signal.
    pub(super) fn at_work_within(&self, grace: Duration) -> &Interrupt {
        // Commands say it once.
        let _ = self.grace.set(grace);
        self.at_work()
    }
}

/// Listens until the process ends.
pub(super) fn listen(words: Words) -> Result<Listener, CliError> {
    let interrupt = Interrupt::new();
    let at_work = Arc::new(AtomicBool::new(false));
    let grace = Arc::new(OnceLock::new());
    let mut signals = Signals::new([SIGINT, SIGTERM])
        .map_err(|e| CliError::other(format!("cannot listen for signals: {e}")))?;
    let listener = Listener {
        interrupt: interrupt.clone(),
        at_work: Arc::clone(&at_work),
        grace: Arc::clone(&grace),
    };
    // Threads that begin after the survey find the memory that it has left, which is for the frames.
    spherule_jobs::start_heart();
    thread::spawn(move || {
        for _ in signals.forever() {
            if interrupt.is_raised() || !at_work.load(Ordering::Acquire) {
                // Nothing is lost: images appear whole or not at all.
                end_now(words);
            }
            interrupt.raise();
            match grace.get() {
                Some(grace) => {
                    say!("{} (grace period: {} s)", words.asked, grace.as_secs_f64());
                    let (grace, interrupt) = (*grace, interrupt.clone());
                    thread::spawn(move || end_after(grace, &interrupt, words));
                }
                None => say!("{}", words.asked),
            }
        }
    });
    Ok(listener)
}

/// Has frames dropped that are still in hand after `grace`.
fn end_after(grace: Duration, interrupt: &Interrupt, words: Words) {
    thread::sleep(grace);
    say!(
        "the grace period of {} s is over (--grace): stopping now",
        grace.as_secs_f64()
    );
    interrupt.raise();
    thread::sleep(WIND_UP);
    end_now(words);
}

/// Ends the process, whatever its threads are at.
fn end_now(words: Words) -> ! {
    say!("{}", words.at_once);
    discard_own_parts();
    events::end_at_once(INTERRUPTED);
    std::process::exit(i32::from(INTERRUPTED));
}
