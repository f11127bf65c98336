//! Requeues finished frames whose outputs are damaged.

use crate::ledger::{LedgerWatcher, LedgerWriter};
use crate::workers::WorkerRegistry;
use crate::{DEFAULT_TAKEOVER_AFTER, EntryStatus, Job, JobError, JobState, Ledger, LedgerEntry};

impl Job {
    /// Requeues frames that were finished in `seen`, each with a reason: the next run repeats them. Their outputs
    /// stay until then. Frames that another worker has repeated meanwhile are left alone. Returns the requeued
    /// frames.
    ///
    /// # Errors
    /// [`JobError::LedgerDamaged`], or a file cannot be read or written.
    pub fn requeue(seen: &JobState, frames: &[(i64, String)]) -> Result<Vec<i64>, JobError> {
        let dir = seen.dir();
        let failed = |e| JobError::io(dir, "requeueing frames", e);
        // Take the lock, so that no other worker writes in between
        let registry = WorkerRegistry::register(dir, DEFAULT_TAKEOVER_AFTER).map_err(failed)?;
        let lock = registry.lock().map_err(failed)?;
        let ledger = Ledger::read(dir)?;
        let mut watcher = LedgerWatcher::new(dir, registry.worker(), &ledger);
        let mut writer = LedgerWriter::new(dir, registry.worker());
        let mut requeued = Vec::new();
        // Requeue each frame, unless its last entry is newer than the one that was seen
        for (frame, reason) in frames {
            let now = ledger.entry(*frame).map(|entry| (entry.seq, entry.status));
            let then = seen.ledger().entry(*frame).map(|entry| entry.seq);
            if now.is_none() || now != then.map(|seq| (seq, EntryStatus::Done)) {
                continue;
            }
            let entry = LedgerEntry::requeued(watcher.next_seq(), *frame, reason.clone());
            writer.append(&entry, true)?;
            requeued.push(*frame);
        }
        lock.complete();
        Ok(requeued)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use serde_json::json;

    use super::*;
    use crate::{FrameRequest, FrameState, JobRequest, ResumeMode};

    fn open(dir: &Path) -> Job {
        let frame = |number| FrameRequest {
            number,
            inputs: Vec::new(),
            companions: Vec::new(),
            outputs: vec![dir.join(format!("f.{number}"))],
        };
        let request = JobRequest {
            settings: Vec::new(),
            frames: (1..=3).map(frame).collect(),
            extra_outputs: Vec::new(),
            selection: None,
            mode: ResumeMode::Resume,
            takeover_after: DEFAULT_TAKEOVER_AFTER,
        };
        Job::open(dir, request, |_| Ok::<_, JobError>(json!(null))).unwrap()
    }

    fn finish(job: &mut Job, dir: &Path, frame: i64) {
        let path = dir.join(format!("f.{frame}"));
        fs::write(&path, "image").unwrap();
        job.record_done(frame, &[path], json!(null)).unwrap();
    }

    #[test]
    fn requeued_frames_are_repeated() {
        let dir = tempfile::tempdir().unwrap();
        let mut job = open(dir.path());
        finish(&mut job, dir.path(), 1);
        finish(&mut job, dir.path(), 2);
        let seen = Job::read(dir.path()).unwrap().unwrap();
        // Another worker has repeated frame 2 meanwhile; 3 was never finished; 9 does not exist
        finish(&mut job, dir.path(), 2);
        drop(job);
        let bad = [1, 2, 3, 9].map(|frame| (frame, format!("f.{frame}: torn")));
        assert_eq!(Job::requeue(&seen, &bad).unwrap(), [1]);
        let now = Job::read(dir.path()).unwrap().unwrap();
        assert_eq!(now.frame_state(1), Some(FrameState::Failed));
        let entry = now.ledger().entry(1).unwrap();
        assert_eq!(entry.reason.as_deref(), Some("f.1: torn"));
        assert!(dir.path().join("f.1").exists());
        let mut job = open(dir.path());
        assert_eq!(job.pending(), [1, 3]);
        finish(&mut job, dir.path(), 1);
        drop(job);
        let again = Job::read(dir.path()).unwrap().unwrap();
        assert_eq!(again.frame_state(1), Some(FrameState::Done));
        // Its entry is no longer the one in `seen`
        assert_eq!(Job::requeue(&seen, &bad).unwrap(), [0; 0]);
    }
}
