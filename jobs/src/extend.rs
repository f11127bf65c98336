//! Extends an open job by the new frames of a growing sequence.

use std::collections::HashSet;

use crate::fingerprint_cache::FingerprintCache;
use crate::planning::{ExtendedPlan, extended_plan};
use crate::{FrameState, InputChange, Job, JobError, JobRequest, JobState, LedgerEntry};

impl Job {
    /// Adds the new frames of a growing sequence to the job, and those selected in `request` to this run.
    /// Finished frames whose inputs have changed are requeued and returned.
    ///
    /// # Errors
    /// Those of [`Job::open`]. The settings must be those that the job was opened with.
    pub fn extend(&mut self, request: &JobRequest) -> Result<Vec<InputChange>, JobError> {
        request.check()?;
        let dir = self.state.dir.clone();
        let new = request.selected();
        let mut fingerprints = FingerprintCache::prefetch(request, &new, Some(&self.state.plan));
        let claims = self.claims.clone();
        let lock_failed = |e| claims.explain(JobError::io(&dir, "locking the job", e));
        let lock = claims.registry().lock().map_err(lock_failed)?;
        self.refresh()?;
        let ExtendedPlan { plan, changes } =
            extended_plan(&self.state, request, &new, &mut fingerprints)?;
        self.state.refuse_existing_outputs(&plan)?;
        // The ledger first: with the new fingerprints in the plan, the old images would count as up to date
        self.requeue_changed(&changes)?;
        if plan != self.state.plan {
            plan.store(&dir)?;
            let ledger = std::mem::take(&mut self.state.ledger);
            self.state = JobState::new(&dir, plan, ledger);
        }
        lock.complete();
        let known: HashSet<i64> = self.selected.iter().copied().collect();
        let added = new.into_iter().filter(|frame| !known.contains(frame));
        self.selected.extend(added);
        Ok(changes)
    }

    fn requeue_changed(&mut self, changes: &[InputChange]) -> Result<(), JobError> {
        if changes.is_empty() {
            return Ok(());
        }
        // The new entries must supersede all others of these frames
        self.claims.refresh()?;
        for change in changes {
            let reason = format!(
                "{}: changed after the frame was finished ({})",
                change.path.display(),
                change.what
            );
            let entry = LedgerEntry::requeued(self.claims.next_seq(), change.frame, reason);
            self.claims.add_requeued(&entry);
            self.record(entry, FrameState::Failed)?;
        }
        Ok(())
    }
}
