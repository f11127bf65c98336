//! A job: its plan and its ledgers, opened for work ([`Job::open`]) or only read ([`Job::read`],
//! [`Job::read_plan`], [`Job::dry_run`]).
//!
//! Any number of processes may have the same job open, on one machine or on several that share its directory.
//! They divide the frames by claims ([`FrameClaims`]). Each writes its own ledger, and one at a time changes
//! the plan.

use std::error::Error;
use std::fs;
use std::io;
use std::panic;
use std::path::{Path, PathBuf};
use std::thread;

use serde_json::Value;

use crate::fingerprint_cache::FingerprintCache;
use crate::ledger::{
    COMPACTED, LedgerFile, LedgerWatcher, LedgerWriter, compact, ledger_files, remove,
};
use crate::planning::{ExtendedPlan, merged_plan, new_plan, stored_path};
use crate::workers::{ListedParts, WorkerRegistry, WorkerStatus, worker_statuses};
use crate::{
    EntryStatus, FrameClaims, FrameFailure, FrameState, InputChange, JobError, JobRequest,
    JobState, JobSummary, Ledger, LedgerEntry, OutputFile, Plan, ResumeMode,
};

/// Number of ledgers of ended workers above which they are compacted into one.
const MAX_LOOSE_LEDGERS: usize = 8;

/// The state that a job would have after [`Job::open`].
#[derive(Debug, Clone)]
pub struct DryRun {
    /// Plan and finished frames.
    pub state: JobState,
    /// The frames of the run, done or not, in the requested order.
    pub selected: Vec<i64>,
    /// The resolved automatic settings of the job; None if they would be resolved again.
    pub resolved: Option<Value>,
    /// Finished frames that would be repeated because their inputs have changed
    /// ([`ResumeMode::RequeueChanged`]).
    pub requeued: Vec<InputChange>,
}

/// A job that is open for work.
#[derive(Debug)]
pub struct Job {
    pub(crate) state: JobState,
    writer: LedgerWriter,
    pub(crate) claims: FrameClaims,
    pub(crate) selected: Vec<i64>,
    requeued: Vec<InputChange>,
}

impl Job {
    /// Reads the plan in `dir`; None if there is no job. Changes nothing.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], or a file cannot be read.
    pub fn read_plan(dir: &Path) -> Result<Option<Plan>, JobError> {
        Plan::load(or_current_dir(dir))
    }

    /// Whether there is a job in `dir`, damaged or not: a plan, or a ledger with lines.
    ///
    /// # Errors
    /// The directory cannot be read.
    pub fn exists(dir: &Path) -> Result<bool, JobError> {
        let dir = or_current_dir(dir);
        Ok(Plan::path_in(dir).exists() || ledger_files(dir)?.iter().any(|file| file.length > 0))
    }

    /// Reads the state of the job in `dir`; None if there is no job. Changes nothing. Other processes may be
    /// working on the job.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], [`JobError::LedgerDamaged`], or a file cannot be read.
    pub fn read(dir: &Path) -> Result<Option<JobState>, JobError> {
        let dir = or_current_dir(dir);
        if !Plan::path_in(dir).exists() {
            return Ok(None);
        }
        let (ledger, plan) = thread::scope(|scope| {
            let plan = scope.spawn(|| Plan::load(dir));
            let ledger = Ledger::read(dir);
            (ledger, plan.join().unwrap_or_else(|e| panic::resume_unwind(e)))
        });
        let ledger = ledger?;
        Ok(plan?.map(|plan| JobState::new(dir, plan, ledger)))
    }

    /// Reads the status of all workers of the job in `dir`, including workers that have crashed. Changes nothing.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn workers(dir: &Path) -> Result<Vec<WorkerStatus>, JobError> {
        let dir = or_current_dir(dir);
        worker_statuses(dir).map_err(|e| JobError::io(dir, "listing workers", e))
    }

    /// The state that the job in `dir` would have after [`Job::open`]. Changes nothing. Other processes may be
    /// working on the job.
    ///
    /// # Errors
    /// Those errors of [`Job::open`] that occur before anything is written.
    pub fn dry_run(dir: &Path, request: &JobRequest) -> Result<DryRun, JobError> {
        let dir = or_current_dir(dir);
        request.check()?;
        let selected = request.selected();
        // Read the state, which a fresh start ignores
        let mut fingerprints = FingerprintCache::default();
        let starts_over = request.mode == ResumeMode::Force || !dir.exists();
        let (old, ledger) = if starts_over {
            (None, Ledger::default())
        } else {
            (Plan::load(dir)?, Ledger::read(dir)?)
        };
        // Plan the frames, with the checks of a real start
        let (plan, ledger, resolves_again, requeued) = match old {
            None => {
                if !starts_over {
                    refuse_ledgers(dir)?;
                }
                if request.mode != ResumeMode::Force {
                    request.refuse_existing_outputs()?;
                }
                let plan = new_plan(dir, request, &mut fingerprints)?;
                (plan, ledger, true, Vec::new())
            }
            Some(old) => {
                let state = JobState::new(dir, old, ledger);
                let mut resolves_again = false;
                let ExtendedPlan { plan, changes } =
                    merged_plan(&state, request, &selected, &mut fingerprints, |_| {
                        resolves_again = true;
                        Ok::<_, JobError>(Value::Null)
                    })?;
                state.refuse_existing_outputs(&plan)?;
                (plan, state.ledger, resolves_again, changes)
            }
        };
        // Apply what would be requeued
        let resolved = (!resolves_again).then(|| plan.resolved().clone());
        let mut state = JobState::new(dir, plan, ledger);
        for change in &requeued {
            state.states.insert(change.frame, FrameState::Pending);
        }
        Ok(DryRun { state, selected, resolved, requeued })
    }

    /// Starts the job in `dir`, or resumes it. Other workers may have the same job open. The directory is
    /// created if needed.
    ///
    /// `resolve` determines the values of automatic settings. It is called only if necessary: with None for a
    /// new job, and with the stored values if settings have changed under [`ResumeMode::KeepDone`]. Otherwise
    /// the stored values are used, also for frames that were added to the sequence.
    ///
    /// # Errors
    /// See [`JobError`]. Finished work stays intact, except that [`ResumeMode::Force`] may have removed some of
    /// the ledgers.
    pub fn open<E: Into<Box<dyn Error + Send + Sync>>>(
        dir: &Path,
        request: JobRequest,
        resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
    ) -> Result<Self, JobError> {
        if request.mode != ResumeMode::RequeueChanged {
            return Self::open_unchanged(dir, request, resolve);
        }
        request.check()?;
        // Open the job without any frames, then add them like those that change while it is open
        let without =
            JobRequest { selection: Some(Vec::new()), mode: ResumeMode::Resume, ..request.clone() };
        let mut job = Self::open_unchanged(dir, without, resolve)?;
        job.requeued = job.extend(&request)?;
        Ok(job)
    }

    /// Opens the job in any mode except [`ResumeMode::RequeueChanged`].
    fn open_unchanged<E: Into<Box<dyn Error + Send + Sync>>>(
        dir: &Path,
        request: JobRequest,
        resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
    ) -> Result<Self, JobError> {
        let dir = or_current_dir(dir);
        request.check()?;
        let selected = request.selected();
        fs::create_dir_all(dir).map_err(|e| JobError::io(dir, "creating the directory", e))?;
        // Compute fingerprints, the slow part, before the lock is taken
        let known = match request.mode {
            ResumeMode::Force => None,
            _ => Plan::load(dir)?,
        };
        let mut fingerprints = FingerprintCache::prefetch(&request, &selected, known.as_ref());
        // Take the lock, and remove what killed runs left behind
        let registry = WorkerRegistry::register(dir, request.takeover_after)
            .map_err(|e| JobError::io(dir, "registering a worker", e))?;
        let lock_failed = |e| JobError::io(dir, "locking the job", e);
        let lock = registry.lock().map_err(lock_failed)?;
        remove_leftovers(dir, &request, &registry)?;
        if request.mode == ResumeMode::Force {
            refuse_other_workers(dir, &registry)?;
            remove_ledgers(dir)?;
        }
        // Read plan and ledgers again: other workers may have changed them before the lock was taken
        let old = match request.mode {
            ResumeMode::Force => None,
            _ => Plan::load(dir)?,
        };
        let ledger = Ledger::read(dir)?;
        let state = match old {
            None => start(dir, &request, ledger, &mut fingerprints, resolve)?,
            Some(plan) => {
                let old = JobState::new(dir, plan, ledger);
                let merged = merged_plan(&old, &request, &selected, &mut fingerprints, resolve)?;
                resume(old, merged.plan, &registry)?
            }
        };
        let watcher = watcher_of(dir, &state.ledger, &registry)?;
        lock.complete();
        Ok(Self {
            writer: LedgerWriter::new(dir, registry.worker()),
            claims: FrameClaims::new(dir, registry, watcher),
            state,
            selected,
            requeued: Vec::new(),
        })
    }

    /// Finished frames that were requeued when the job was opened, because their inputs had changed
    /// ([`ResumeMode::RequeueChanged`]).
    pub fn requeued(&self) -> &[InputChange] {
        &self.requeued
    }

    /// Claims frames of this job.
    pub fn claims(&self) -> FrameClaims {
        self.claims.clone()
    }

    /// Reads plan and ledgers again, which other workers may have changed.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], [`JobError::LedgerDamaged`], or a file cannot be read.
    pub fn refresh(&mut self) -> Result<(), JobError> {
        let dir = self.state.dir.clone();
        let plan = match Plan::load(&dir)? {
            Some(plan) => plan,
            None => self.state.plan.clone(),
        };
        self.state = JobState::new(&dir, plan, Ledger::read(&dir)?);
        Ok(())
    }

    /// The current state of the job.
    pub const fn state(&self) -> &JobState {
        &self.state
    }

    /// The resolved automatic settings.
    pub const fn resolved(&self) -> &Value {
        self.state.plan.resolved()
    }

    /// The frames of this run, done or not, in the requested order.
    pub fn selected(&self) -> &[i64] {
        &self.selected
    }

    /// Frames of this run that are not done, in the requested order. They include failed ones, which a new run
    /// tries again.
    pub fn pending(&self) -> Vec<i64> {
        let is_pending = |frame: &i64| !self.state.is_done(*frame);
        self.selected.iter().copied().filter(is_pending).collect()
    }

    /// Counts the frames of this run by state.
    pub fn summary(&self) -> JobSummary {
        self.state.summary_of(self.selected.iter().copied())
    }

    /// Records that `frame` is done. The `outputs` must exist already.
    ///
    /// # Errors
    /// An output does not exist, the frame is not in the plan, or the ledger cannot be written. The ledger is
    /// then unchanged.
    pub fn record_done(
        &mut self,
        frame: i64,
        outputs: &[PathBuf],
        details: Value,
    ) -> Result<(), JobError> {
        let mut files = Vec::with_capacity(outputs.len());
        for path in outputs {
            let metadata =
                fs::metadata(path).map_err(|e| JobError::io(path, "checking the output", e))?;
            files.push(OutputFile {
                path: stored_path(&self.state.dir, path)?,
                len: metadata.len(),
            });
        }
        let mut entry =
            LedgerEntry::new(self.claims.next_seq(), frame, EntryStatus::Done, &details);
        entry.outputs = files;
        self.record(entry, FrameState::Done)
    }

    /// Records the failure of a frame.
    ///
    /// # Errors
    /// The frame is not in the plan, or the ledger cannot be written.
    pub fn record_failed(&mut self, failure: &FrameFailure) -> Result<(), JobError> {
        let seq = self.claims.next_seq();
        let mut entry = LedgerEntry::new(seq, failure.frame, EntryStatus::Failed, &Value::Null);
        entry.reason = Some(failure.to_string());
        entry.failure = Some(failure.kind);
        self.record(entry, FrameState::Failed)
    }

    /// Syncs all records to disk. Without this call they are synced within some tenths of a second, or at the end
    /// of the job.
    ///
    /// # Errors
    /// The ledger cannot be written.
    pub fn sync(&mut self) -> Result<(), JobError> {
        self.writer.sync()
    }

    pub(crate) fn record(&mut self, entry: LedgerEntry, state: FrameState) -> Result<(), JobError> {
        let frame = entry.frame;
        let Some(slot) = self.state.states.get_mut(&frame) else {
            return Err(JobError::UnknownFrame { frame });
        };
        let is_shared = self.claims.has_other_workers();
        let appended = self.writer.append(&entry, is_shared);
        appended.map_err(|e| self.claims.explain(e))?;
        *slot = state;
        self.state.ledger.merge(entry);
        Ok(())
    }
}

impl DryRun {
    /// Frames of the run that are not done, in the requested order.
    pub fn pending(&self) -> Vec<i64> {
        let is_pending = |frame: &i64| !self.state.is_done(*frame);
        self.selected.iter().copied().filter(is_pending).collect()
    }

    /// Counts the frames of the run by state.
    pub fn summary(&self) -> JobSummary {
        self.state.summary_of(self.selected.iter().copied())
    }
}

fn start<E: Into<Box<dyn Error + Send + Sync>>>(
    dir: &Path,
    request: &JobRequest,
    ledger: Ledger,
    fingerprints: &mut FingerprintCache,
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<JobState, JobError> {
    refuse_ledgers(dir)?;
    if request.mode != ResumeMode::Force {
        request.refuse_existing_outputs()?;
    }
    let mut plan = new_plan(dir, request, fingerprints)?;
    plan.set_resolved(resolve(None).map_err(|e| JobError::Resolve(e.into()))?);
    plan.store(dir)?;
    Ok(JobState::new(dir, plan, ledger))
}

/// Refuses ledgers without a plan.
fn refuse_ledgers(dir: &Path) -> Result<(), JobError> {
    let mut files = ledger_files(dir)?.into_iter();
    match files.find(|file| file.length > 0) {
        Some(LedgerFile { path, .. }) => Err(JobError::PlanMissing { ledger: path }),
        None => Ok(()),
    }
}

fn resume(old: JobState, plan: Plan, registry: &WorkerRegistry) -> Result<JobState, JobError> {
    if plan == old.plan {
        return Ok(old);
    }
    if plan.settings() != old.plan.settings() {
        // Other workers keep using the settings that they started with
        refuse_other_workers(&old.dir, registry)?;
    }
    old.refuse_existing_outputs(&plan)?;
    plan.store(&old.dir)?;
    Ok(JobState::new(&old.dir, plan, old.ledger))
}

/// Refuses an operation that is not possible while other workers are active. Waits for a heartbeat of those that may
/// have died with their machine.
fn refuse_other_workers(dir: &Path, registry: &WorkerRegistry) -> Result<(), JobError> {
    let beating = registry.wait_for_others();
    match beating.map_err(|e| JobError::io(dir, "listing workers", e))? {
        Some(other) => Err(JobError::Busy { dir: dir.to_owned(), worker: other.description() }),
        None => Ok(()),
    }
}

/// Removes all ledgers, so that no frame counts as done. The plan stays until the next one replaces it. A kill in
/// between thus leaves no images without a plan.
fn remove_ledgers(dir: &Path) -> Result<(), JobError> {
    ledger_files(dir)?.iter().try_for_each(remove)
}

/// Compacts the ledgers of ended workers if there are many. Returns whether it did.
fn compact_ledgers(
    dir: &Path,
    ledger: &Ledger,
    registry: &WorkerRegistry,
) -> Result<bool, JobError> {
    let names = registry.worker_names();
    let active = names.map_err(|e| JobError::io(dir, "listing workers", e))?;
    let mut files = ledger_files(dir)?;
    files.retain(|file| !active.contains(&file.worker));
    let loose = files.iter().filter(|file| file.worker != COMPACTED).count();
    if loose <= MAX_LOOSE_LEDGERS {
        return Ok(false);
    }
    compact(dir, ledger, &files)?;
    Ok(true)
}

/// Compacts the ledgers if there are many, and returns a watcher of what is added to them from now on.
fn watcher_of(
    dir: &Path,
    ledger: &Ledger,
    registry: &WorkerRegistry,
) -> Result<LedgerWatcher, JobError> {
    if compact_ledgers(dir, ledger, registry)? {
        // Lines have moved to another file
        return Ok(LedgerWatcher::new(dir, registry.worker(), &Ledger::read(dir)?));
    }
    Ok(LedgerWatcher::new(dir, registry.worker(), ledger))
}

/// Removes incomplete files of killed runs, from the job's directory and from those of its outputs.
fn remove_leftovers(
    dir: &Path,
    request: &JobRequest,
    registry: &WorkerRegistry,
) -> Result<(), JobError> {
    // Find all directories with files of the job
    let failed = |e| JobError::io(dir, "removing incomplete files of a killed run", e);
    let outputs = request.frames.iter().flat_map(|f| &f.outputs);
    let mut dirs: Vec<&Path> = outputs.filter_map(|path| path.parent()).collect();
    dirs.push(dir);
    dirs.sort_unstable();
    dirs.dedup();
    // Look for incomplete files; a directory that does not exist has none
    let mut parts = ListedParts::default();
    for dir in &dirs {
        match parts.add(dir) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                let doing = "removing incomplete files of a killed run";
                return Err(JobError::io(dir, doing, e));
            }
            _ => {}
        }
    }
    // Remove those of dead workers
    parts.remove_stale(&registry.remove_dead().map_err(failed)?);
    registry.set_output_dirs(dirs.into_iter().map(Path::to_owned).collect());
    Ok(())
}

/// The directory of a bare file name is the current directory.
fn or_current_dir(dir: &Path) -> &Path {
    if dir.as_os_str().is_empty() { Path::new(".") } else { dir }
}
