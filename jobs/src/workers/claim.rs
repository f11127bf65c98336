//! Claims: exclusive rights of one worker, to a frame or to the plan.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use super::files::{link_exclusively, remove_if_exists};
use super::{Liveness, WorkerRecord, WorkerRegistry};
use crate::{EntryStatus, open_regular};

/// The result of an attempt to claim.
#[derive(Debug)]
pub enum ClaimOutcome {
    /// This worker holds the claim until it is dropped.
    Acquired(Claim),
    /// Another worker holds it; the text describes that worker.
    Held(String),
    /// Another worker has finished the frame since this worker started.
    Finished(EntryStatus),
}

/// An exclusive right of this worker. When it is dropped, another worker can claim the same.
#[derive(Debug)]
pub struct Claim {
    registry: Arc<WorkerRegistry>,
    name: String,
    generation: u32,
    is_complete: bool,
}

/// More than the number of dead workers at one frame that any job can have.
const MAX_GENERATIONS: u32 = 1 << 20;

/// Time between attempts to lock the job. Locks are held for milliseconds.
const LOCK_INTERVAL: Duration = Duration::from_millis(5);

impl WorkerRegistry {
    /// Claims `frame`.
    pub(crate) fn claim_frame(self: &Arc<Self>, frame: i64) -> io::Result<ClaimOutcome> {
        Claim::acquire(self, format!("frame.{frame}"))
    }

    /// Claims the right to change the plan and to remove files of dead workers. Blocks until it is free.
    pub(crate) fn lock(self: &Arc<Self>) -> io::Result<Claim> {
        loop {
            match Claim::acquire(self, "lock".to_owned())? {
                ClaimOutcome::Acquired(claim) => return Ok(claim),
                ClaimOutcome::Held(_) | ClaimOutcome::Finished(_) => {
                    self.clock().sleep(LOCK_INTERVAL);
                }
            }
        }
    }
}

impl Claim {
    /// Claims `name`; [`ClaimOutcome::Held`] if a living worker has it.
    fn acquire(registry: &Arc<WorkerRegistry>, name: String) -> io::Result<ClaimOutcome> {
        let mut generation = 0;
        while generation < MAX_GENERATIONS {
            let path = registry.work_dir.join(file_name(&name, generation));
            // Create a link for the claim, which only one worker can
            if link_exclusively(&registry.record_path, &path, &registry.record_line)? {
                let claim = Self::new(registry, name, generation);
                return Ok(match claim.rival() {
                    None => ClaimOutcome::Acquired(claim),
                    Some(rival) => ClaimOutcome::Held(rival.description()),
                });
            }
            // Somebody else has it: find out whether they are alive
            let (liveness, record) = match WorkerRecord::read(&path) {
                Ok(Some(record)) => {
                    let liveness = registry.monitor.of_worker(&registry.work_dir, &record);
                    (liveness, Some(record))
                }
                Ok(None) => (registry.monitor.of_file(&path), None),
                // The claim was dropped in between: try again
                Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                // Treat anything else like an unreadable claim. Workers create regular files only, so no
                // worker is behind a pipe or a directory
                Err(_) => (registry.monitor.of_file(&path), None),
            };
            // Decide; the claim of a dead worker is passed by with the next generation
            match (liveness, record) {
                // A network file system may repeat a request whose reply was lost
                (_, Some(record)) if record.worker == registry.record.worker => {
                    let claim = Self::new(registry, name, generation);
                    return Ok(ClaimOutcome::Acquired(claim));
                }
                (Liveness::Alive, record) => {
                    let holder =
                        record.map_or_else(|| "another process".to_owned(), |r| r.description());
                    return Ok(ClaimOutcome::Held(holder));
                }
                (Liveness::Unresponsive, Some(record)) => registry.declare_dead(&record)?,
                (Liveness::Ended | Liveness::Unresponsive, _) => {}
            }
            generation += 1;
        }
        Err(io::Error::other("too many dead claims; remove job.work"))
    }

    fn new(registry: &Arc<WorkerRegistry>, name: String, generation: u32) -> Self {
        Self { registry: Arc::clone(registry), name, generation, is_complete: false }
    }

    /// A living worker with a claim of another generation. This happens if the dead claim before this one was
    /// removed meanwhile and its name was claimed again. Both workers create their claim before they check, so
    /// at least one of them yields.
    fn rival(&self) -> Option<WorkerRecord> {
        let registry = &self.registry;
        let others = (0..self.generation).chain(std::iter::once(self.generation + 1));
        for generation in others {
            let record = match WorkerRecord::read(&self.path(generation)) {
                Ok(Some(record)) if record.worker != registry.record.worker => record,
                _ => continue,
            };
            if registry.monitor.of_worker(&registry.work_dir, &record) == Liveness::Alive {
                return Some(record);
            }
        }
        None
    }

    /// Whether other workers still consider this worker alive. Check it before you publish a file: a worker
    /// that was suspended while others took over, or restarted with other settings, must not overwrite theirs.
    pub fn is_valid(&self) -> bool {
        !self.registry.is_declared_dead() && open_regular(&self.registry.record_path).is_ok()
    }

    /// Ends the claim after the work is recorded. Also removes the claims of dead workers before this one.
    pub fn complete(mut self) {
        self.is_complete = true;
    }

    fn path(&self, generation: u32) -> PathBuf {
        let name = file_name(&self.name, generation);
        self.registry.work_dir.join(name)
    }
}

impl Drop for Claim {
    /// Other workers treat a claim that could not be removed as dead when this worker is gone.
    fn drop(&mut self) {
        let _ = remove_if_exists(&self.path(self.generation));
        if self.is_complete {
            for generation in 0..self.generation {
                let _ = remove_if_exists(&self.path(generation));
            }
        }
    }
}

fn file_name(name: &str, generation: u32) -> String {
    format!("{name}.{generation}")
}
