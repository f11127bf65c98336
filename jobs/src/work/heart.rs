//! Signs of life: one thread a process makes the cards of its workers longer.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, Once};
use std::thread;
use std::time::{Duration, Instant};

/// A card to be made longer by a byte now and then.
#[derive(Debug)]
struct Beat {
    card: PathBuf,
    pause: Duration,
    next: Instant,
    /// Set once the card is gone.
    is_buried: Arc<AtomicBool>,
}

static BEATS: Mutex<Vec<Beat>> = Mutex::new(Vec::new());
static CHANGED: Condvar = Condvar::new();

fn beats() -> MutexGuard<'static, Vec<Beat>> {
    BEATS.lock().unwrap_or_else(|e| e.into_inner())
}

/// Starts the thread that gives signs of life, unless it runs. It is started anyway when it is needed; a
/// caller to whom it matters which thread finds what memory another has left may do it before.
pub fn start_heart() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        thread::spawn(run);
    });
}

/// From now on `card` is made longer every `pause`, until it is gone: then `is_buried` becomes true.
pub(super) fn begin(card: &Path, pause: Duration, is_buried: &Arc<AtomicBool>) {
    start_heart();
    beats().push(Beat {
        card: card.to_owned(),
        pause,
        next: Instant::now() + pause,
        is_buried: Arc::clone(is_buried),
    });
    CHANGED.notify_one();
}

/// `card` is not touched any more once this returns.
pub(super) fn end(card: &Path) {
    beats().retain(|beat| beat.card != card);
}

fn run() {
    let mut beats = beats();
    loop {
        let now = Instant::now();
        beats.retain_mut(|beat| beat.next > now || beat.give(now));
        let next = beats.iter().map(|beat| beat.next).min();
        let pause = next.map_or(Duration::MAX, |next| next.saturating_duration_since(now));
        beats = match CHANGED.wait_timeout(beats, pause.min(Duration::from_secs(3600))) {
            Ok((beats, _)) => beats,
            Err(poisoned) => poisoned.into_inner().0,
        };
    }
}

impl Beat {
    /// Whether there is a card still. A full disk is no death.
    fn give(&mut self, now: Instant) -> bool {
        self.next = now + self.pause;
        let given = self.append();
        let is_gone = given.is_err_and(|e| e.kind() == io::ErrorKind::NotFound);
        if is_gone {
            self.is_buried.store(true, Ordering::Relaxed);
        }
        !is_gone
    }

    fn append(&self) -> io::Result<()> {
        // Opening a pipe in the card's place would wait for a reader.
        if !fs::metadata(&self.card)?.is_file() {
            return Err(io::ErrorKind::NotFound.into());
        }
        let mut file = OpenOptions::new().append(true).open(&self.card)?;
        file.write_all(b".")
    }
}
