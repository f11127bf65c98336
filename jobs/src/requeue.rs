//! Setting finished frames back, when what was made of them is no good.

use crate::ledger::{LedgerWriter, News};
use crate::work::Desk;
use crate::{DEFAULT_PATIENCE, Entry, Job, JobError, JobState, Ledger, Status};

impl Job {
    /// Sets frames back that were finished when `seen` was read, each with what is wrong with it: the next
    /// run makes them anew. Their outputs stay until then. Returns those that were set back: what another
    /// worker has made anew meanwhile stays.
    ///
    /// # Errors
    /// [`JobError::LedgerDamaged`], or trouble with files.
    pub fn requeue(seen: &JobState, frames: &[(i64, String)]) -> Result<Vec<i64>, JobError> {
        let dir = seen.dir();
        let failed = |e| JobError::io(dir, "setting frames back", e);
        let desk = Desk::take(dir, DEFAULT_PATIENCE).map_err(failed)?;
        let lock = desk.lock().map_err(failed)?;
        let ledger = Ledger::read(dir)?;
        let mut news = News::new(dir, desk.worker(), &ledger);
        let mut writer = LedgerWriter::new(dir, desk.worker());
        let mut set_back = Vec::new();
        for (frame, reason) in frames {
            let now = ledger.entry(*frame).map(|entry| (entry.seq, entry.status));
            let then = seen.ledger().entry(*frame).map(|entry| entry.seq);
            if now.is_none() || now != then.map(|seq| (seq, Status::Done)) {
                continue;
            }
            let entry = Entry::set_back(news.take_seq(), *frame, reason.clone());
            writer.append(&entry, true)?;
            set_back.push(*frame);
        }
        lock.end();
        Ok(set_back)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use serde_json::json;

    use super::*;
    use crate::{FrameRequest, FrameState, JobRequest, Mode};

    fn open(dir: &Path) -> Job {
        let frame = |number| FrameRequest {
            number,
            inputs: Vec::new(),
            outputs: vec![dir.join(format!("f.{number}"))],
        };
        let request = JobRequest {
            settings: Vec::new(),
            frames: (1..=3).map(frame).collect(),
            extra_outputs: Vec::new(),
            selection: None,
            mode: Mode::Resume,
            patience: DEFAULT_PATIENCE,
        };
        Job::open(dir, request, |_| Ok::<_, JobError>(json!(null))).unwrap()
    }

    fn make(job: &mut Job, dir: &Path, frame: i64) {
        let path = dir.join(format!("f.{frame}"));
        fs::write(&path, "image").unwrap();
        job.record_done(frame, &[path], json!(null)).unwrap();
    }

    #[test]
    fn frames_set_back_are_made_anew() {
        let dir = tempfile::tempdir().unwrap();
        let mut job = open(dir.path());
        make(&mut job, dir.path(), 1);
        make(&mut job, dir.path(), 2);
        let seen = Job::read(dir.path()).unwrap().unwrap();
        // Another worker was quicker with frame 2; frame 3 was never finished, 9 is none.
        make(&mut job, dir.path(), 2);
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
        make(&mut job, dir.path(), 1);
        drop(job);
        let again = Job::read(dir.path()).unwrap().unwrap();
        assert_eq!(again.frame_state(1), Some(FrameState::Done));
        // It stands no more as it did when it was looked at.
        assert_eq!(Job::requeue(&seen, &bad).unwrap(), [0; 0]);
    }
}
