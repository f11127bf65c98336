//! Heartbeats: one thread per process appends to the records of its workers.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, Once, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::clock::Clock;

/// A worker record to which one byte is appended at a regular interval.
#[derive(Debug)]
struct Heartbeat {
    record_path: PathBuf,
    interval: Duration,
    next: Instant,
    /// Set when the record is gone: another worker has removed it.
    is_declared_dead: Arc<AtomicBool>,
}

/// The heartbeats of some workers, by one clock.
#[derive(Debug)]
pub(super) struct HeartbeatSchedule {
    heartbeats: Mutex<Vec<Heartbeat>>,
    changed: Condvar,
    clock: Clock,
}

/// The heartbeats of this process.
static SCHEDULE: HeartbeatSchedule = HeartbeatSchedule::new(Clock::System);

/// Starts the heartbeat thread unless it is running. The thread is started on demand anyway. Call this earlier
/// if it matters which thread reuses the memory that another one has freed.
pub fn start_heartbeat_thread() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        thread::spawn(|| SCHEDULE.run());
    });
}

impl HeartbeatSchedule {
    /// An empty schedule. Nobody keeps it but the caller, with [`Self::beat_due`].
    pub(super) const fn new(clock: Clock) -> Self {
        Self { heartbeats: Mutex::new(Vec::new()), changed: Condvar::new(), clock }
    }

    /// The schedule of this process, which a thread keeps.
    pub(super) fn of_process() -> &'static Self {
        start_heartbeat_thread();
        &SCHEDULE
    }

    pub(super) const fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Appends to the record every `interval` until the record is gone; then sets `is_declared_dead`.
    pub(super) fn add(
        &self,
        record_path: &Path,
        interval: Duration,
        is_declared_dead: &Arc<AtomicBool>,
    ) {
        self.heartbeats().push(Heartbeat {
            record_path: record_path.to_owned(),
            interval,
            next: self.clock.now() + interval,
            is_declared_dead: Arc::clone(is_declared_dead),
        });
        self.changed.notify_one();
    }

    /// Stops the heartbeats of this record. The record is no longer written to when this returns.
    pub(super) fn remove(&self, record_path: &Path) {
        self.heartbeats().retain(|heartbeat| heartbeat.record_path != record_path);
    }

    /// Appends to the records whose time has come.
    #[cfg(test)]
    pub(super) fn beat_due(&self) {
        beat_due(&mut self.heartbeats(), self.clock.now());
    }

    fn run(&self) {
        let mut heartbeats = self.heartbeats();
        loop {
            let now = self.clock.now();
            beat_due(&mut heartbeats, now);
            let next = heartbeats.iter().map(|heartbeat| heartbeat.next).min();
            let wait = next
                .map_or(Duration::MAX, |next| next.saturating_duration_since(now))
                .min(Duration::from_secs(3600));
            let woken = self.changed.wait_timeout(heartbeats, wait);
            heartbeats = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn heartbeats(&self) -> MutexGuard<'_, Vec<Heartbeat>> {
        self.heartbeats.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn beat_due(heartbeats: &mut Vec<Heartbeat>, now: Instant) {
    heartbeats.retain_mut(|heartbeat| heartbeat.next > now || heartbeat.beat(now));
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
