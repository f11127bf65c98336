//! TERM and Ctrl-C: the first asks the job to finish the frame in hand, the second stops at once.

use std::thread;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use spherule_jobs::Interrupt;

use super::{CliError, INTERRUPTED};

/// Raises the returned flag on the first signal and ends the process on the second.
pub(super) fn listen() -> Result<Interrupt, CliError> {
    let interrupt = Interrupt::new();
    let mut signals = Signals::new([SIGINT, SIGTERM])
        .map_err(|e| CliError::other(format!("cannot listen for signals: {e}")))?;
    let flag = interrupt.clone();
    thread::spawn(move || {
        for _ in signals.forever() {
            if flag.is_raised() {
                // Nothing is lost: images appear whole or not at all, and what was being written
                // is cleared away by the next run.
                std::process::exit(i32::from(INTERRUPTED));
            }
            flag.raise();
            say!("stopping after the frame in hand; once more stops at once");
        }
    });
    Ok(interrupt)
}
