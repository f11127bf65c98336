//! Heartbeats: one thread per process appends to the records of its workers.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, Once};
use std::thread;
use std::time::{Duration, Instant};

/// A worker record to which one byte is appended at a regular interval.
#[derive(Debug)]
struct Heartbeat {
    record_path: PathBuf,
    interval: Duration,
    next: Instant,
    /// Set when the record is gone: another worker has removed it.
    is_declared_dead: Arc<AtomicBool>,
}

static HEARTBEATS: Mutex<Vec<Heartbeat>> = Mutex::new(Vec::new());
static CHANGED: Condvar = Condvar::new();

fn heartbeats() -> MutexGuard<'static, Vec<Heartbeat>> {
    HEARTBEATS.lock().unwrap_or_else(|e| e.into_inner())
}

/// Starts the heartbeat thread unless it is running. The thread is started on demand anyway. Call this earlier
/// if it matters which thread reuses the memory that another one has freed.
pub fn start_heartbeat_thread() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        thread::spawn(run);
    });
}

/// Appends to the record every `interval` until the record is gone; then sets `is_declared_dead`.
pub(super) fn start(record_path: &Path, interval: Duration, is_declared_dead: &Arc<AtomicBool>) {
    start_heartbeat_thread();
    heartbeats().push(Heartbeat {
        record_path: record_path.to_owned(),
        interval,
        next: Instant::now() + interval,
        is_declared_dead: Arc::clone(is_declared_dead),
    });
    CHANGED.notify_one();
}

/// Stops the heartbeats of this record. The record is no longer written to when this returns.
pub(super) fn stop(record_path: &Path) {
    heartbeats().retain(|heartbeat| heartbeat.record_path != record_path);
}

fn run() {
    let mut heartbeats = heartbeats();
    loop {
        let now = Instant::now();
        heartbeats.retain_mut(|heartbeat| heartbeat.next > now || heartbeat.beat(now));
        let next = heartbeats.iter().map(|heartbeat| heartbeat.next).min();
        let wait = next.map_or(Duration::MAX, |next| next.saturating_duration_since(now));
        heartbeats = match CHANGED.wait_timeout(heartbeats, wait.min(Duration::from_secs(3600))) {
            Ok((heartbeats, _)) => heartbeats,
            Err(poisoned) => poisoned.into_inner().0,
        };
    }
}

impl Heartbeat {
    /// Returns whether the record still exists. A failed write, on a full disk for example, is not a death.
    fn beat(&mut self, now: Instant) -> bool {
        self.next = now + self.interval;
        let appended = self.append();
        let is_gone = appended.is_err_and(|e| e.kind() == io::ErrorKind::NotFound);
        if is_gone {
            self.is_declared_dead.store(true, Ordering::Relaxed);
        }
        !is_gone
    }

    fn append(&self) -> io::Result<()> {
        // Opening a pipe in place of the record would wait for a reader
        if !fs::metadata(&self.record_path)?.is_file() {
            return Err(io::ErrorKind::NotFound.into());
        }
        let mut file = OpenOptions::new().append(true).open(&self.record_path)?;
        file.write_all(b".")
    }
}
