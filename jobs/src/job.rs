//! A job: plan and ledgers together, opened for work ([`Job::open`]) or only looked at
//! ([`Job::read`], [`Job::peek`], [`Job::foresee`]).
//!
//! Any number of processes may have the same job open, on one machine or on several that share its
//! directory. They agree on who does what by claims ([`Claims`]), each writes a ledger of its own, and
//! one at a time changes the plan.

use std::error::Error;
use std::fs;
use std::io;
use std::panic;
use std::path::{Path, PathBuf};
use std::thread;

use serde_json::Value;

use crate::fingerprint_cache::FingerprintCache;
use crate::ledger::{ENDED, LedgerFile, LedgerWriter, News, fold, ledger_files, remove};
use crate::planning::{Extension, merged_plan, new_plan, stored_path};
use crate::work::{Desk, WorkerView, sweep_parts, workers};
use crate::{
    Claims, Entry, FrameState, InputChange, JobError, JobRequest, JobState, Ledger, Mode,
    OutputFile, Plan, Status, Summary, foreign,
};

/// So many ledgers of workers that have ended may lie about before they are brought together in one.
const LOOSE_LEDGERS: usize = 8;

/// How a job would stand if it were opened.
#[derive(Debug, Clone)]
pub struct Foreseen {
    /// Its plan and what is done of it.
    pub state: JobState,
    /// The frames of the run, done or not, in the order asked for.
    pub selected: Vec<i64>,
    /// What "auto" turned into when the job began; None if that would be settled anew.
    pub resolved: Option<Value>,
    /// Finished frames that would be made again because their inputs have changed
    /// ([`Mode::RequeueChanged`]).
    pub requeued: Vec<InputChange>,
}

/// A job opened for work.
#[derive(Debug)]
pub struct Job {
    pub(crate) state: JobState,
    writer: LedgerWriter,
    pub(crate) claims: Claims,
    pub(crate) selected: Vec<i64>,
    requeued: Vec<InputChange>,
}

impl Job {
    /// The plan in `dir`, or None if no job has begun there. Touches nothing.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], or trouble reading.
    pub fn peek(dir: &Path) -> Result<Option<Plan>, JobError> {
        Plan::load(named(dir))
    }

    /// Whether a job has begun in `dir`, damaged or not: there is a plan, or a ledger with lines.
    ///
    /// # Errors
    /// Trouble reading the directory.
    pub fn has_begun(dir: &Path) -> Result<bool, JobError> {
        let dir = named(dir);
        Ok(Plan::path_in(dir).exists() || ledger_files(dir)?.iter().any(|file| file.length > 0))
    }

    /// How the job in `dir` stands, or None if none has begun there. Touches nothing, and may be
    /// asked while another process works.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], [`JobError::LedgerDamaged`], or trouble reading.
    pub fn read(dir: &Path) -> Result<Option<JobState>, JobError> {
        let dir = named(dir);
        if !Plan::path_in(dir).exists() {
            return Ok(None);
        }
        let (ledger, plan) = thread::scope(|scope| {
            let plan = scope.spawn(|| Plan::load(dir));
            let ledger = Ledger::read(dir);
            (
                ledger,
                plan.join().unwrap_or_else(|e| panic::resume_unwind(e)),
            )
        });
        let ledger = ledger?;
        Ok(plan?.map(|plan| JobState::new(dir, plan, ledger)))
    }

    /// Who is at work in `dir`, also workers that died without a word. Touches nothing.
    ///
    /// # Errors
    /// Trouble reading.
    pub fn workers(dir: &Path) -> Result<Vec<WorkerView>, JobError> {
        let dir = named(dir);
        workers(dir).map_err(|e| JobError::io(dir, "looking for workers", e))
    }

    /// How the job in `dir` would stand after [`Job::open`]. Touches nothing, and may be asked while
    /// another process works.
    ///
    /// # Errors
    /// Those of [`Job::open`] that are known before anything is written.
    pub fn foresee(dir: &Path, request: &JobRequest) -> Result<Foreseen, JobError> {
        let dir = named(dir);
        request.check()?;
        let selected = request.selected();
        let mut prints = FingerprintCache::default();
        let forgotten = request.mode == Mode::Force || !dir.exists();
        let (old, ledger) = if forgotten {
            (None, Ledger::default())
        } else {
            (Plan::load(dir)?, Ledger::read(dir)?)
        };
        let (plan, ledger, settled_anew, requeued) = match old {
            None => {
                if !forgotten {
                    refuse_ledgers(dir)?;
                }
                if request.mode != Mode::Force {
                    foreign::refuse_at_begin(request)?;
                }
                let plan = new_plan(dir, request, &mut prints)?;
                (plan, ledger, true, Vec::new())
            }
            Some(old) => {
                let state = JobState::new(dir, old, ledger);
                let mut anew = false;
                let Extension { plan, changes } =
                    merged_plan(&state, request, &selected, &mut prints, |_| {
                        anew = true;
                        Ok::<_, JobError>(Value::Null)
                    })?;
                foreign::refuse_new(&state, &plan)?;
                (plan, state.ledger, anew, changes)
            }
        };
        let resolved = (!settled_anew).then(|| plan.resolved().clone());
        let mut state = JobState::new(dir, plan, ledger);
        for change in &requeued {
            state.states.insert(change.frame, FrameState::Pending);
        }
        Ok(Foreseen {
            state,
            selected,
            resolved,
            requeued,
        })
    }

    /// Begins the job in `dir` (created if need be), or goes on with it, alone or beside others.
    ///
    /// `resolve` settles what "auto" means. It is called only when that has to be settled: for a
    /// new job with None, and with the saved values when settings have changed under
    /// [`Mode::KeepDone`]. In any other case the saved values stand, also for frames that have
    /// been added to the sequence.
    ///
    /// # Errors
    /// See [`JobError`]; after any of them, finished work is as it was, except that
    /// [`Mode::Force`] may already have removed some of the ledgers.
    pub fn open<E: Into<Box<dyn Error + Send + Sync>>>(
        dir: &Path,
        request: JobRequest,
        resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
    ) -> Result<Self, JobError> {
        if request.mode != Mode::RequeueChanged {
            return Self::open_as_planned(dir, request, resolve);
        }
        request.check()?;
        // Opened without the frames that may have changed, the job then takes them in as it does those that
        // change while it is open.
        let without = JobRequest {
            selection: Some(Vec::new()),
            mode: Mode::Resume,
            ..request.clone()
        };
        let mut job = Self::open_as_planned(dir, without, resolve)?;
        job.requeued = job.extend(&request)?;
        Ok(job)
    }

    /// Opens it in any mode but [`Mode::RequeueChanged`].
    fn open_as_planned<E: Into<Box<dyn Error + Send + Sync>>>(
        dir: &Path,
        request: JobRequest,
        resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
    ) -> Result<Self, JobError> {
        let dir = named(dir);
        request.check()?;
        let selected = request.selected();
        fs::create_dir_all(dir).map_err(|e| JobError::io(dir, "creating the directory", e))?;
        // The slow part is done before others are kept waiting.
        let known = match request.mode {
            Mode::Force => None,
            _ => Plan::load(dir)?,
        };
        let mut prints = FingerprintCache::ahead(&request, &selected, known.as_ref());
        let desk = Desk::take(dir, request.patience)
            .map_err(|e| JobError::io(dir, "beginning to work in it", e))?;
        let locking = |e| JobError::io(dir, "agreeing with other workers", e);
        let lock = desk.lock().map_err(locking)?;
        clean(dir, &request, &desk)?;
        if request.mode == Mode::Force {
            alone(dir, &desk)?;
            start_over(dir)?;
        }
        let old = match request.mode {
            Mode::Force => None,
            _ => Plan::load(dir)?,
        };
        let ledger = Ledger::read(dir)?;
        let state = match old {
            None => begin(dir, &request, ledger, &mut prints, resolve)?,
            Some(plan) => {
                let old = JobState::new(dir, plan, ledger);
                let merged = merged_plan(&old, &request, &selected, &mut prints, resolve)?;
                go_on(old, merged.plan, &desk)?
            }
        };
        let news = if fold_ended(dir, &state.ledger, &desk)? {
            // Lines have moved from file to file.
            News::new(dir, desk.worker(), &Ledger::read(dir)?)
        } else {
            News::new(dir, desk.worker(), &state.ledger)
        };
        lock.end();
        Ok(Self {
            writer: LedgerWriter::new(dir, desk.worker()),
            claims: Claims::new(dir, desk, news),
            state,
            selected,
            requeued: Vec::new(),
        })
    }

    /// Finished frames that were set back when the job was opened, because their inputs had changed
    /// ([`Mode::RequeueChanged`]).
    pub fn requeued(&self) -> &[InputChange] {
        &self.requeued
    }

    /// What the frames of this job are claimed by, before they are worked on.
    pub fn claims(&self) -> Claims {
        self.claims.clone()
    }

    /// Reads again what all workers have planned and said so far.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], [`JobError::LedgerDamaged`], or trouble reading.
    pub fn refresh(&mut self) -> Result<(), JobError> {
        let dir = self.state.dir.clone();
        let plan = match Plan::load(&dir)? {
            Some(plan) => plan,
            None => self.state.plan.clone(),
        };
        self.state = JobState::new(&dir, plan, Ledger::read(&dir)?);
        Ok(())
    }

    /// The job as it stands now.
    pub const fn state(&self) -> &JobState {
        &self.state
    }

    /// What "auto" turned into.
    pub const fn resolved(&self) -> &Value {
        self.state.plan.resolved()
    }

    /// The frames of this run, done or not, in the order asked for.
    pub fn selected(&self) -> &[i64] {
        &self.selected
    }

    /// Frames of this run that are not done, in the order asked for. Failed ones are among them:
    /// a new run tries them again.
    pub fn pending(&self) -> Vec<i64> {
        let open = |frame: &i64| !self.state.is_done(*frame);
        self.selected.iter().copied().filter(open).collect()
    }

    /// How the frames of this run stand.
    pub fn summary(&self) -> Summary {
        self.state.summary_of(self.selected.iter().copied())
    }

    /// Records that `frame` is done. `outputs` must be in place: image first, ledger second.
    ///
    /// # Errors
    /// An output is not there, the frame is not in the plan, or the ledger cannot be written; the
    /// ledger is then as before.
    pub fn record_done(
        &mut self,
        frame: i64,
        outputs: &[PathBuf],
        details: Value,
    ) -> Result<(), JobError> {
        let mut files = Vec::with_capacity(outputs.len());
        for path in outputs {
            let metadata = fs::metadata(path)
                .map_err(|e| JobError::io(path, "looking for the output just written", e))?;
            files.push(OutputFile {
                path: stored_path(&self.state.dir, path)?,
                len: metadata.len(),
            });
        }
        let mut entry = Entry::new(self.claims.take_seq(), frame, Status::Done, &details);
        entry.outputs = files;
        self.record(entry, FrameState::Done)
    }

    /// Records that `frame` could not be made, and why.
    ///
    /// # Errors
    /// The frame is not in the plan, or the ledger cannot be written.
    pub fn record_failed(
        &mut self,
        frame: i64,
        reason: &str,
        details: Value,
    ) -> Result<(), JobError> {
        let mut entry = Entry::new(self.claims.take_seq(), frame, Status::Failed, &details);
        entry.reason = Some(reason.to_owned());
        self.record(entry, FrameState::Failed)
    }

    /// Everything recorded so far is on the disk when this returns. Else that may be some tenths of a second
    /// later, or at the end of the job.
    ///
    /// # Errors
    /// The ledger cannot be written.
    pub fn sync(&mut self) -> Result<(), JobError> {
        self.writer.sync()
    }

    pub(crate) fn record(&mut self, entry: Entry, state: FrameState) -> Result<(), JobError> {
        let frame = entry.frame;
        let Some(slot) = self.state.states.get_mut(&frame) else {
            return Err(JobError::Request(format!(
                "frame {frame} is not in the plan"
            )));
        };
        self.writer.append(&entry, self.claims.has_company())?;
        *slot = state;
        self.state.ledger.take_in(entry);
        Ok(())
    }
}

impl Foreseen {
    /// Frames of the run that are not done, in the order asked for.
    pub fn pending(&self) -> Vec<i64> {
        let open = |frame: &i64| !self.state.is_done(*frame);
        self.selected.iter().copied().filter(open).collect()
    }

    /// How the frames of the run stand.
    pub fn summary(&self) -> Summary {
        self.state.summary_of(self.selected.iter().copied())
    }
}

fn begin<E: Into<Box<dyn Error + Send + Sync>>>(
    dir: &Path,
    request: &JobRequest,
    ledger: Ledger,
    prints: &mut FingerprintCache,
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<JobState, JobError> {
    refuse_ledgers(dir)?;
    if request.mode != Mode::Force {
        foreign::refuse_at_begin(request)?;
    }
    let mut plan = new_plan(dir, request, prints)?;
    plan.resolve(resolve(None).map_err(|e| JobError::Resolve(e.into()))?);
    plan.store(dir)?;
    Ok(JobState::new(dir, plan, ledger))
}

/// Refuses ledgers that no plan explains.
fn refuse_ledgers(dir: &Path) -> Result<(), JobError> {
    let mut files = ledger_files(dir)?.into_iter();
    match files.find(|file| file.length > 0) {
        Some(LedgerFile { path, .. }) => Err(JobError::PlanMissing { ledger: path }),
        None => Ok(()),
    }
}

fn go_on(old: JobState, plan: Plan, desk: &Desk) -> Result<JobState, JobError> {
    if plan == old.plan {
        return Ok(old);
    }
    if plan.settings() != old.plan.settings() {
        // The others make their images with what they began with.
        alone(&old.dir, desk)?;
    }
    foreign::refuse_new(&old, &plan)?;
    plan.store(&old.dir)?;
    Ok(JobState::new(&old.dir, plan, old.ledger))
}

/// Refuses what must not be done while others work.
fn alone(dir: &Path, desk: &Desk) -> Result<(), JobError> {
    let others = desk.others();
    let others = others.map_err(|e| JobError::io(dir, "looking for other workers", e))?;
    match others.first() {
        Some(other) => Err(JobError::Busy {
            dir: dir.to_owned(),
            who: other.told(),
        }),
        None => Ok(()),
    }
}

/// A plan without ledgers means nothing is done. It stays until the next one replaces it, so that a kill in
/// between does not leave images that no plan knows.
fn start_over(dir: &Path) -> Result<(), JobError> {
    ledger_files(dir)?.iter().try_for_each(remove)
}

/// Brings ledgers of ended workers together if there are many; whether it did.
fn fold_ended(dir: &Path, ledger: &Ledger, desk: &Desk) -> Result<bool, JobError> {
    let names = desk.names();
    let at_work = names.map_err(|e| JobError::io(dir, "looking for other workers", e))?;
    let mut files = ledger_files(dir)?;
    files.retain(|file| !at_work.contains(&file.worker));
    let loose = files.iter().filter(|file| file.worker != ENDED).count();
    if loose <= LOOSE_LEDGERS {
        return Ok(false);
    }
    fold(dir, ledger, &files)?;
    Ok(true)
}

/// Removes what killed runs left half written, here and where outputs go.
fn clean(dir: &Path, request: &JobRequest, desk: &Desk) -> Result<(), JobError> {
    let failed = |e| JobError::io(dir, "removing leftovers of a killed run", e);
    let at_work = desk.sweep().map_err(failed)?;
    let outputs = request.frames.iter().flat_map(|f| &f.outputs);
    let mut dirs: Vec<&Path> = outputs.filter_map(|path| path.parent()).collect();
    dirs.push(dir);
    dirs.sort_unstable();
    dirs.dedup();
    for dir in &dirs {
        match sweep_parts(dir, &at_work) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                return Err(JobError::io(dir, "removing leftovers of a killed run", e));
            }
            _ => {}
        }
    }
    desk.writes_to(dirs.into_iter().map(Path::to_owned).collect());
    Ok(())
}

/// The directory of a bare file name is the current one.
fn named(dir: &Path) -> &Path {
    if dir.as_os_str().is_empty() {
        Path::new(".")
    } else {
        dir
    }
}
