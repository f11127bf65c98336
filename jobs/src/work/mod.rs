//! Who is at work in a job's directory, and on what: the files in `job.work`.
//!
//! Every worker has a *card* there, `WORKER.worker`: who it is, and a point more every few seconds as a
//! sign of life. What it has in hand it *claims*: `frame.12.0` appears only if it is not there, as
//! another name (a hard link) of the card, so it says at once who holds it. All of this needs no more of
//! a file system than that a name can be made by one alone: no locks, no clocks that agree, no appending
//! by several.
//!
//! A claim is dead if its process has ended (seen on the same machine), if its card is gone, or if the
//! card has not changed for a while by the clock of whoever looks. Nobody takes a dead claim away from
//! under its name, since two might and the second would take what the first had just made: they claim
//! the next generation, `frame.12.1`, which again one alone can make.
//!
//! Claims save work; they keep nothing safe. A worker that was taken for dead and comes back makes the
//! same images under the same names, whole, and tells so in a ledger of its own.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::open_regular;

mod card;
mod claim;
mod desk;
mod files;
mod heart;
#[cfg(test)]
mod tests;
mod view;

pub(crate) use card::Card;
pub use claim::{Claim, Claimed};
pub(crate) use desk::Desk;
pub(crate) use files::sweep_parts;
pub use heart::start_heart;
pub use view::WorkerView;
pub(crate) use view::workers;

/// Name of the directory in the job's directory.
const WORK_DIR: &str = "job.work";

/// The end of a card's name.
const CARD: &str = ".worker";

/// Signs of life that a worker must have missed, however impatient others are.
const MISSED: u32 = 4;

/// Whether what is at a path was made by no living worker: nothing, or no regular file.
fn is_none_of_ours(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    matches!(
        error.kind(),
        Kind::NotFound | Kind::IsADirectory | Kind::InvalidInput
    )
}

/// Whether whoever left a file still works.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Standing {
    /// As far as can be known.
    Alive,
    /// It has ended.
    Ended,
    /// No sign of life for so long that it is taken for dead.
    Silent,
}

/// Signs of life as they were seen.
#[derive(Debug)]
pub(crate) struct Watch {
    patience: Duration,
    /// Length of the file and when it was first seen so, by the file's path.
    seen: Mutex<HashMap<PathBuf, (u64, Instant)>>,
}

impl Watch {
    /// Takes a worker for dead after this long without a sign of life.
    fn new(patience: Duration) -> Self {
        Self {
            patience,
            seen: Mutex::default(),
        }
    }

    /// How the owner of `card` stands.
    fn standing(&self, work: &Path, card: &Card) -> Standing {
        if card.process.has_ended() {
            return Standing::Ended;
        }
        let least = card.pause().saturating_mul(MISSED);
        self.signs_for(&work.join(card.file_name()), self.patience.max(least))
    }

    /// How whoever makes the file at `path` longer stands.
    fn signs(&self, path: &Path) -> Standing {
        self.signs_for(path, self.patience)
    }

    fn signs_for(&self, path: &Path, patience: Duration) -> Standing {
        // Network file systems look again at what is opened, not at what is asked about.
        let length = match open_regular(path) {
            Ok((_, metadata)) => metadata.len(),
            Err(e) if is_none_of_ours(&e) => return Standing::Ended,
            Err(_) => u64::MAX,
        };
        let mut seen = self.seen.lock().unwrap_or_else(|e| e.into_inner());
        let now = Instant::now();
        let (before, since) = seen.entry(path.to_owned()).or_insert((length, now));
        if *before != length {
            (*before, *since) = (length, now);
        }
        if now.duration_since(*since) >= patience {
            Standing::Silent
        } else {
            Standing::Alive
        }
    }
}
