//! Watches the ledgers of the other workers while this one works.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::files::{ReadPosition, ledger_files, ledger_path, read_entries};
use super::{EntryStatus, Ledger, LedgerEntry};
use crate::JobError;

/// How often the only worker of a job looks for ledgers of workers that have started and ended since.
pub(super) const RESCAN_INTERVAL: Duration = Duration::from_secs(2);

/// The parts of an entry that are kept in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct EntrySummary {
    seq: u64,
    time_ms: u64,
    frame: i64,
    status: EntryStatus,
    is_requeued: bool,
}

impl From<&LedgerEntry> for EntrySummary {
    fn from(entry: &LedgerEntry) -> Self {
        Self {
            seq: entry.seq,
            time_ms: entry.time_ms,
            frame: entry.frame,
            status: entry.status,
            is_requeued: entry.is_requeued,
        }
    }
}

/// The latest entry of each frame, kept up to date.
#[derive(Debug)]
pub(crate) struct LedgerWatcher {
    dir: PathBuf,
    /// The ledger of this worker, which is not read.
    own_path: PathBuf,
    positions: BTreeMap<PathBuf, ReadPosition>,
    latest: HashMap<i64, EntrySummary>,
    /// The latest entries when this worker started, or when the frame was requeued.
    baseline: HashMap<i64, EntrySummary>,
    next_seq: u64,
    last_scan: Option<Instant>,
    /// Whether there were other workers at the last refresh.
    had_other_workers: bool,
}

impl LedgerWatcher {
    /// Starts with the entries of `ledger`.
    pub(crate) fn new(dir: &Path, worker: &str, ledger: &Ledger) -> Self {
        let latest: HashMap<i64, EntrySummary> =
            ledger.entries().map(|entry| (entry.frame, entry.into())).collect();
        Self {
            dir: dir.to_owned(),
            own_path: ledger_path(dir, worker),
            positions: ledger.positions.clone(),
            baseline: latest.clone(),
            latest,
            next_seq: ledger.next_seq,
            last_scan: None,
            had_other_workers: true,
        }
    }

    /// The result of `frame` if another worker has finished it since this one started.
    pub(crate) fn finished_by_other(&self, frame: i64) -> Option<EntryStatus> {
        let entry = self.latest.get(&frame)?;
        (self.baseline.get(&frame) != Some(entry)).then_some(entry.status)
    }

    /// A sequence number for an entry that supersedes all known ones.
    pub(crate) fn next_seq(&mut self) -> u64 {
        let seq = self.next_seq;
        self.next_seq = seq.saturating_add(1);
        seq
    }

    /// Reads new entries in the ledgers of these `workers` and in the known ledgers, at the time `now`.
    pub(crate) fn refresh(&mut self, workers: &[String], now: Instant) -> Result<(), JobError> {
        for worker in workers {
            self.watch(ledger_path(&self.dir, worker));
        }
        // A worker may have started and ended since the last refresh. That is rare if there are no others
        let is_alone = workers.len() < 2 && !self.had_other_workers;
        self.had_other_workers = workers.len() > 1;
        let is_recent = |last: Instant| now.duration_since(last) < RESCAN_INTERVAL;
        let mut scan = !is_alone || !self.last_scan.is_some_and(is_recent);
        loop {
            if scan {
                self.last_scan = Some(now);
                for file in ledger_files(&self.dir)? {
                    self.watch(file.path);
                }
            }
            let has_vanished = self.read_new_entries()?;
            if scan || !has_vanished {
                return Ok(());
            }
            // A ledger was compacted into another one
            scan = true;
        }
    }

    /// Registers an entry with which this worker has requeued a frame. Earlier results of the frame no longer
    /// count.
    pub(crate) fn add_requeued(&mut self, entry: &LedgerEntry) {
        self.add(entry.into());
    }

    fn watch(&mut self, path: PathBuf) {
        if path != self.own_path {
            self.positions.entry(path).or_default();
        }
    }

    /// Returns whether a ledger that had entries has vanished.
    fn read_new_entries(&mut self) -> Result<bool, JobError> {
        let mut has_vanished = false;
        let mut positions = std::mem::take(&mut self.positions);
        let mut first_error = None;
        positions.retain(|path, position| {
            match read_entries(path, position, |entry| self.add((&entry).into())) {
                Ok(true) => true,
                // Not written yet, or removed
                Ok(false) => {
                    has_vanished |= *position != ReadPosition::default();
                    false
                }
                Err(error) => {
                    first_error.get_or_insert(error);
                    true
                }
            }
        });
        self.positions = positions;
        first_error.map_or(Ok(has_vanished), Err)
    }

    fn add(&mut self, entry: EntrySummary) {
        self.next_seq = self.next_seq.max(entry.seq.saturating_add(1));
        let known = self.latest.get(&entry.frame);
        if known
            .is_none_or(|known| supersedes((entry.seq, entry.status), (known.seq, known.status)))
        {
            self.latest.insert(entry.frame, entry);
            if entry.is_requeued {
                self.baseline.insert(entry.frame, entry);
            }
        }
    }
}

/// Whether an entry with this sequence number and status supersedes the `known` one.
pub(super) fn supersedes(new: (u64, EntryStatus), known: (u64, EntryStatus)) -> bool {
    // Equal numbers come from workers that did not know of each other. A finished frame stays finished
    new.0 > known.0 || (new.0 == known.0 && new.1 == EntryStatus::Done)
}
