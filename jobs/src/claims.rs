//! Claims of frames: how workers divide the frames of a job.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use crate::clock::Clock;
use crate::ledger::LedgerWatcher;
use crate::workers::{ClaimOutcome, WorkerRegistry};
use crate::{EntryStatus, JobError, LedgerEntry};

/// Claims frames for a worker. Clones belong to the same worker.
#[derive(Debug, Clone)]
pub struct FrameClaims {
    dir: PathBuf,
    registry: Arc<WorkerRegistry>,
    watcher: Arc<Mutex<LedgerWatcher>>,
    /// Whether other workers were registered at the last refresh.
    has_other_workers: Arc<AtomicBool>,
}

impl FrameClaims {
    pub(crate) fn new(dir: &Path, registry: Arc<WorkerRegistry>, watcher: LedgerWatcher) -> Self {
        Self {
            dir: dir.to_owned(),
            registry,
            watcher: Arc::new(Mutex::new(watcher)),
            has_other_workers: Arc::new(AtomicBool::new(true)),
        }
    }

    pub(crate) const fn registry(&self) -> &Arc<WorkerRegistry> {
        &self.registry
    }

    pub(crate) fn clock(&self) -> &Clock {
        self.registry.clock()
    }

    /// Claims `frame`, which was pending when this worker started.
    ///
    /// # Errors
    /// [`JobError::DeclaredDead`], [`JobError::LedgerDamaged`], or a file cannot be read or written.
    pub fn claim(&self, frame: i64) -> Result<ClaimOutcome, JobError> {
        if self.registry.is_declared_dead() {
            return Err(self.declared_dead());
        }
        if let Some(status) = self.finished_by_other(frame) {
            return Ok(ClaimOutcome::Finished(status));
        }
        let outcome = self.registry.claim_frame(frame);
        let outcome =
            outcome.map_err(|e| self.explain(JobError::io(&self.dir, "claiming a frame", e)))?;
        // A worker records a frame before it drops the claim, so this sees whoever had it before
        self.refresh().map_err(|e| self.explain(e))?;
        Ok(match (self.finished_by_other(frame), outcome) {
            (Some(status), outcome) => {
                if let ClaimOutcome::Acquired(claim) = outcome {
                    claim.complete();
                }
                ClaimOutcome::Finished(status)
            }
            (None, outcome) => outcome,
        })
    }

    /// The error that ends the run: if other workers have declared this worker dead and removed its files, that is the
    /// reason why `error` occurred.
    pub(crate) fn explain(&self, error: JobError) -> JobError {
        if self.registry.has_lost_record() { self.declared_dead() } else { error }
    }

    fn declared_dead(&self) -> JobError {
        JobError::DeclaredDead { dir: self.dir.clone() }
    }

    fn finished_by_other(&self, frame: i64) -> Option<EntryStatus> {
        self.watcher().finished_by_other(frame)
    }

    /// Reads new entries of the other workers.
    pub(crate) fn refresh(&self) -> Result<(), JobError> {
        let names = self.registry.worker_names();
        let workers = names.map_err(|e| JobError::io(&self.dir, "listing workers", e))?;
        self.has_other_workers.store(workers.len() > 1, Ordering::Relaxed);
        let now = self.clock().now();
        self.watcher().refresh(&workers, now)
    }

    /// Whether other workers may be waiting for the entries of this worker.
    pub(crate) fn has_other_workers(&self) -> bool {
        self.has_other_workers.load(Ordering::Relaxed)
    }

    /// A sequence number for an entry that supersedes all known ones.
    pub(crate) fn next_seq(&self) -> u64 {
        self.watcher().next_seq()
    }

    /// Registers an entry with which this worker has requeued a frame.
    pub(crate) fn add_requeued(&self, entry: &LedgerEntry) {
        self.watcher().add_requeued(entry);
    }

    fn watcher(&self) -> std::sync::MutexGuard<'_, LedgerWatcher> {
        self.watcher.lock().unwrap_or_else(|e| e.into_inner())
    }
}
