//! Sharing the frames of a job among workers.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use crate::ledger::News;
use crate::work::{Claimed, Desk};
use crate::{Entry, JobError, Status};

/// What a worker claims frames by; clones are the same worker's.
#[derive(Debug, Clone)]
pub struct Claims {
    dir: PathBuf,
    desk: Arc<Desk>,
    news: Arc<Mutex<News>>,
    /// Whether there were other workers when it was last looked.
    has_company: Arc<AtomicBool>,
}

impl Claims {
    pub(crate) fn new(dir: &Path, desk: Arc<Desk>, news: News) -> Self {
        Self {
            dir: dir.to_owned(),
            desk,
            news: Arc::new(Mutex::new(news)),
            has_company: Arc::new(AtomicBool::new(true)),
        }
    }

    pub(crate) const fn desk(&self) -> &Arc<Desk> {
        &self.desk
    }

    /// Claims `frame`, which was still to be done when this worker began.
    ///
    /// # Errors
    /// [`JobError::TakenForDead`], [`JobError::LedgerDamaged`], or trouble with files.
    pub fn take(&self, frame: i64) -> Result<Claimed, JobError> {
        if self.desk.is_buried() {
            let dir = self.dir.clone();
            return Err(JobError::TakenForDead { dir });
        }
        if let Some(status) = self.ended(frame) {
            return Ok(Claimed::Ended(status));
        }
        let claimed = self.desk.claim_frame(frame);
        let claimed = claimed.map_err(|e| JobError::io(&self.dir, "claiming a frame", e))?;
        // Whoever has ended the frame has said so before the claim was given back.
        self.refresh()?;
        Ok(match (self.ended(frame), claimed) {
            (Some(status), claimed) => {
                if let Claimed::Mine(claim) = claimed {
                    claim.end();
                }
                Claimed::Ended(status)
            }
            (None, claimed) => claimed,
        })
    }

    fn ended(&self, frame: i64) -> Option<Status> {
        self.news().ended(frame)
    }

    /// Takes in what others have said.
    pub(crate) fn refresh(&self) -> Result<(), JobError> {
        let workers = self.desk.names();
        let workers =
            workers.map_err(|e| JobError::io(&self.dir, "looking for other workers", e))?;
        self.has_company.store(workers.len() > 1, Ordering::Relaxed);
        self.news().refresh(&workers)
    }

    /// Whether others may wait for what this worker says.
    pub(crate) fn has_company(&self) -> bool {
        self.has_company.load(Ordering::Relaxed)
    }

    /// A number for an entry that comes after all known ones.
    pub(crate) fn take_seq(&self) -> u64 {
        self.news().take_seq()
    }

    /// Takes in that this worker has set a frame back.
    pub(crate) fn set_back(&self, entry: &Entry) {
        self.news().set_back(entry);
    }

    fn news(&self) -> std::sync::MutexGuard<'_, News> {
        self.news.lock().unwrap_or_else(|e| e.into_inner())
    }
}
