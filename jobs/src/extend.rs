//! Taking in what a growing sequence has become while the job is open.

use std::collections::HashSet;

use crate::fingerprint_cache::FingerprintCache;
use crate::planning::{Extension, extended_plan};
use crate::{Entry, FrameState, InputChange, Job, JobError, JobRequest, JobState, foreign};

impl Job {
    /// Takes in the frames that a growing sequence has by now; those selected in `request` are added to those
    /// of this run. Finished ones whose inputs have changed since are set back, to be made anew, and returned.
    ///
    /// # Errors
    /// Those of [`Job::open`]; settings must be those that the job was opened with.
    pub fn extend(&mut self, request: &JobRequest) -> Result<Vec<InputChange>, JobError> {
        request.check()?;
        let dir = self.state.dir.clone();
        let new = request.selected();
        let mut prints = FingerprintCache::ahead(request, &new, Some(&self.state.plan));
        let locking = |e| JobError::io(&dir, "agreeing with other workers", e);
        let lock = self.claims.desk().lock().map_err(locking)?;
        self.refresh()?;
        let Extension { plan, changes } = extended_plan(&self.state, request, &new, &mut prints)?;
        foreign::refuse_new(&self.state, &plan)?;
        // Ledger first: a plan with the new fingerprints would call the old images up to date.
        self.set_back(&changes)?;
        if plan != self.state.plan {
            plan.store(&dir)?;
            let ledger = std::mem::take(&mut self.state.ledger);
            self.state = JobState::new(&dir, plan, ledger);
        }
        lock.end();
        let known: HashSet<i64> = self.selected.iter().copied().collect();
        let added = new.into_iter().filter(|frame| !known.contains(frame));
        self.selected.extend(added);
        Ok(changes)
    }

    fn set_back(&mut self, changes: &[InputChange]) -> Result<(), JobError> {
        if changes.is_empty() {
            return Ok(());
        }
        // What is said now must come after all that was said of these frames.
        self.claims.refresh()?;
        for change in changes {
            let reason = format!(
                "{}: changed after the frame was finished ({})",
                change.path.display(),
                change.what
            );
            let entry = Entry::set_back(self.claims.take_seq(), change.frame, reason);
            self.claims.set_back(&entry);
            self.record(entry, FrameState::Failed)?;
        }
        Ok(())
    }
}
