//! TERM and Ctrl-C. The first signal asks the job to finish the frames in progress, within the grace period. The
//! second stops at once. Before any frame is in progress, the first one stops at once too.
//!
//! When the grace period ends, tracing drops its frame. Stages that do not check the interrupt (reading, tree
//! builders, encoders) get a moment more, then the process exits.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use spherule_jobs::{Interrupt, discard_own_parts};

use super::{CliError, INTERRUPTED, events};

/// Time after the grace period to record frames and to write reports.
const SHUTDOWN_TIME: Duration = Duration::from_secs(2);

/// Messages after a signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct SignalMessages {
    /// After the first signal, with frames in progress.
    pub(super) stopping: &'static str,
    /// When the process exits at once.
    pub(super) stopped: &'static str,
}

/// Listens for signals until the process ends.
pub(super) struct SignalListener {
    /// Raised by the first signal once frames are in progress.
    interrupt: Interrupt,
    has_started: Arc<AtomicBool>,
    /// How long frames in progress may take after the first signal; unlimited if not set.
    grace: Arc<OnceLock<Duration>>,
}

impl SignalListener {
    /// Declares that frames are in progress from now on.
    pub(super) fn start_work(&self) -> &Interrupt {
        self.has_started.store(true, Ordering::Release);
        &self.interrupt
    }

    /// Declares that frames are in progress from now on. They are dropped if they take longer than `grace` after
    /// the first signal.
    pub(super) fn start_work_with_grace(&self, grace: Duration) -> &Interrupt {
        // A command calls this once
        let _ = self.grace.set(grace);
        self.start_work()
    }
}

/// Starts to listen for signals.
pub(super) fn listen(messages: SignalMessages) -> Result<SignalListener, CliError> {
    let interrupt = Interrupt::new();
    let has_started = Arc::new(AtomicBool::new(false));
    let grace = Arc::new(OnceLock::new());
    let signals =
        arrivals().map_err(|e| CliError::other(format!("cannot listen for signals: {e}")))?;
    let listener = SignalListener {
        interrupt: interrupt.clone(),
        has_started: Arc::clone(&has_started),
        grace: Arc::clone(&grace),
    };
    // Threads that start after the survey reuse the memory that it has freed, which should be left to the frames
    spherule_jobs::start_heartbeat_thread();
    thread::spawn(move || {
        for () in signals {
            if interrupt.is_raised() || !has_started.load(Ordering::Acquire) {
                // Nothing is lost: images appear complete or not at all
                exit_now(messages);
            }
            interrupt.raise();
            match grace.get() {
                Some(grace) => {
                    message!("{} (grace period: {} s)", messages.stopping, grace.as_secs_f64());
                    let (grace, interrupt) = (*grace, interrupt.clone());
                    thread::spawn(move || stop_after(grace, &interrupt, messages));
                }
                None => message!("{}", messages.stopping),
            }
        }
    });
    Ok(listener)
}

/// The signals that arrive from now on, forever.
#[cfg(unix)]
fn arrivals() -> io::Result<impl Iterator<Item = ()> + Send> {
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    Ok(std::iter::from_fn(move || signals.forever().next().map(|_| ())))
}

/// The signals that arrive from now on, forever. Other systems cannot wait for one.
#[cfg(not(unix))]
fn arrivals() -> io::Result<impl Iterator<Item = ()> + Send> {
    const INTERVAL: Duration = Duration::from_millis(50);
    let arrived = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&arrived))?;
    }
    Ok(std::iter::repeat_with(move || {
        while !arrived.swap(false, Ordering::AcqRel) {
            thread::sleep(INTERVAL);
        }
    }))
}

/// Drops the frames that are still in progress after `grace`.
fn stop_after(grace: Duration, interrupt: &Interrupt, messages: SignalMessages) {
    thread::sleep(grace);
    message!("the grace period of {} s is over (--grace): stopping now", grace.as_secs_f64());
    interrupt.raise();
    thread::sleep(SHUTDOWN_TIME);
    exit_now(messages);
}

/// Ends the process, whatever its threads are doing.
fn exit_now(messages: SignalMessages) -> ! {
    message!("{}", messages.stopped);
    discard_own_parts();
    events::end_at_once(INTERRUPTED);
    exit_at_once()
}

/// Ends the process with [`INTERRUPTED`] while other threads work. Functions that libraries have registered for the end of
/// the process are not called: that of a driver would wait for all that its GPU has to do, or crash under these threads.
pub(super) fn exit_at_once() -> ! {
    signal_hook::low_level::exit(i32::from(INTERRUPTED))
}
