//! Whether another worker is still alive, judged by its process and its heartbeats.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::WorkerRecord;
use crate::clock::Clock;
use crate::open_regular;

/// Heartbeats that a worker must have missed before it counts as unresponsive, however short the timeout of
/// the observer is.
const MIN_MISSED_HEARTBEATS: u32 = 4;

/// Whether the worker that created a file is still working.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Liveness {
    /// It is alive as far as can be known.
    Alive,
    /// It has ended.
    Ended,
    /// It has missed its heartbeats for longer than the timeout.
    Unresponsive,
}

/// Observes the heartbeats of other workers.
#[derive(Debug)]
pub(super) struct LivenessMonitor {
    /// A worker without a heartbeat for this long is unresponsive.
    timeout: Duration,
    clock: Clock,
    /// The last observation of each file.
    observed: Mutex<HashMap<PathBuf, Observation>>,
}

/// What is known of a file to which heartbeats are appended.
#[derive(Debug, Clone, Copy)]
struct Observation {
    length: u64,
    /// When this length was first observed.
    since: Instant,
    /// Whether the length has changed since the first observation: only a living worker does that.
    has_beaten: bool,
}

impl LivenessMonitor {
    pub(super) fn new(timeout: Duration, clock: Clock) -> Self {
        Self { timeout, clock, observed: Mutex::default() }
    }

    /// The liveness of the worker with this record in the directory `work_dir`.
    pub(super) fn of_worker(&self, work_dir: &Path, record: &WorkerRecord) -> Liveness {
        if record.process.has_ended() {
            return Liveness::Ended;
        }
        let min_timeout = record.heartbeat_interval().saturating_mul(MIN_MISSED_HEARTBEATS);
        let path = work_dir.join(record.file_name());
        self.observe(&path, self.timeout.max(min_timeout))
    }

    /// The liveness of the worker that appends to the file at `path`.
    pub(super) fn of_file(&self, path: &Path) -> Liveness {
        self.observe(path, self.timeout)
    }

    /// Whether a heartbeat of the worker with this record has been observed.
    pub(super) fn has_beaten(&self, work_dir: &Path, record: &WorkerRecord) -> bool {
        let observed = self.observed.lock().unwrap_or_else(|e| e.into_inner());
        let observation = observed.get(&work_dir.join(record.file_name()));
        observation.is_some_and(|observation| observation.has_beaten)
    }

    fn observe(&self, path: &Path, timeout: Duration) -> Liveness {
        // Network file systems revalidate attributes on open, not on stat
        let length = match open_regular(path) {
            Ok((_, metadata)) => metadata.len(),
            Err(e) if cannot_be_a_worker(&e) => return Liveness::Ended,
            Err(_) => u64::MAX,
        };
        let mut observed = self.observed.lock().unwrap_or_else(|e| e.into_inner());
        let now = self.clock.now();
        let first = Observation { length, since: now, has_beaten: false };
        let last = observed.entry(path.to_owned()).or_insert(first);
        if last.length != length {
            *last = Observation { has_beaten: true, ..first };
        }
        if now.duration_since(last.since) >= timeout {
            Liveness::Unresponsive
        } else {
            Liveness::Alive
        }
    }
}

/// Whether the error shows that no living worker created the path: it does not exist or is not a regular file.
fn cannot_be_a_worker(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    matches!(error.kind(), Kind::NotFound | Kind::IsADirectory | Kind::InvalidInput)
}
