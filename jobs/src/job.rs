//! A job: plan and ledger together, opened for work ([`Job::open`]) or only looked at
//! ([`Job::read`], [`Job::peek`], [`Job::foresee`]).
//!
//! One process works in a directory at a time as yet; its ledger is locked. A second worker would
//! come under a name of its own ([`JobRequest::worker`]) and claim frames.

use std::collections::{HashMap, HashSet};
use std::error::Error;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::ledger::{Ledger, LedgerWriter, ledger_files};
use crate::publish::remove_leftovers;
use crate::{
    Entry, Fingerprint, FrameRange, FrameState, InputChange, JobError, JobState, OutputFile, Plan,
    PlannedFrame, PlannedInput, Status, Summary,
};

/// Worker name of a process that works alone.
pub const DEFAULT_WORKER: &str = "main";

/// What to do with what an earlier run left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Go on with it; refuse if settings, or inputs of finished frames, have changed.
    #[default]
    Resume,
    /// Forget plan and ledgers. Images stay until they are replaced.
    Force,
    /// Finished frames stay finished whatever has changed; the rest is done as asked now.
    KeepDone,
}

/// What the caller wants done.
#[derive(Debug, Clone)]
pub struct JobRequest {
    /// Name of this worker's ledger: letters, digits, `-`, `_`, `.`.
    pub worker: String,
    /// Everything that outputs depend on besides the inputs: dotted key and value.
    pub settings: Vec<(String, String)>,
    /// All frames there are, each number and each output once.
    pub frames: Vec<FrameRequest>,
    /// Which of them to do in this run, in this order; all if None. Not part of the job's identity.
    pub selection: Option<FrameRange>,
    /// What to do with what an earlier run left.
    pub mode: Mode,
}

/// One frame of a [`JobRequest`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameRequest {
    /// The frame's number.
    pub number: i64,
    /// Files it is made from; they need not be readable.
    pub inputs: Vec<PathBuf>,
    /// Files it will be made into.
    pub outputs: Vec<PathBuf>,
}

/// How a job would stand if it were opened.
#[derive(Debug, Clone)]
pub struct Foreseen {
    /// Its plan and what is done of it.
    pub state: JobState,
    /// The frames of the run, done or not, in the order asked for.
    pub selected: Vec<i64>,
    /// What "auto" turned into when the job began; None if that would be settled anew.
    pub resolved: Option<Value>,
}

/// A job opened for work.
#[derive(Debug)]
pub struct Job {
    state: JobState,
    writer: LedgerWriter,
    selected: Vec<i64>,
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
        Ok(Plan::path_in(dir).exists() || ledger_files(dir)?.iter().any(|(_, len)| *len > 0))
    }

    /// How the job in `dir` stands, or None if none has begun there. Touches nothing, and may be
    /// asked while another process works.
    ///
    /// # Errors
    /// [`JobError::PlanDamaged`], [`JobError::LedgerDamaged`], or trouble reading.
    pub fn read(dir: &Path) -> Result<Option<JobState>, JobError> {
        let dir = named(dir);
        match Plan::load(dir)? {
            Some(plan) => Ok(Some(JobState::new(dir, plan, Ledger::read(dir)?))),
            None => Ok(None),
        }
    }

    /// How the job in `dir` would stand after [`Job::open`]. Touches nothing, and may be asked while
    /// another process works.
    ///
    /// # Errors
    /// Those of [`Job::open`] that are known before anything is written.
    pub fn foresee(dir: &Path, request: &JobRequest) -> Result<Foreseen, JobError> {
        let dir = named(dir);
        check_request(request)?;
        let selected = select(request);
        let forgotten = request.mode == Mode::Force || !dir.exists();
        let (old, ledger) = if forgotten {
            (None, Ledger::default())
        } else {
            (Plan::load(dir)?, Ledger::read(dir)?)
        };
        let (plan, ledger, settled_anew) = match old {
            None => {
                if !forgotten {
                    refuse_ledgers(dir)?;
                }
                (new_plan(dir, request, Value::Null)?, ledger, true)
            }
            Some(old) => {
                let state = JobState::new(dir, old, ledger);
                let mut anew = false;
                let plan = merged_plan(&state, request, &selected, |_| {
                    anew = true;
                    Ok::<_, JobError>(Value::Null)
                })?;
                (plan, state.ledger, anew)
            }
        };
        let resolved = (!settled_anew).then(|| plan.resolved().clone());
        Ok(Foreseen {
            state: JobState::new(dir, plan, ledger),
            selected,
            resolved,
        })
    }

    /// Begins the job in `dir` (created if need be), or goes on with it.
    ///
    /// `resolve` settles what "auto" means. It is called only when that has to be settled: for a
    /// new job with None, and with the saved values when settings have changed under
    /// [`Mode::KeepDone`]. In any other case the saved values stand, also for frames that have
    /// been added to the sequence.
    ///
    /// # Errors
    /// See [`JobError`]; after any of them, finished work is as it was, except that
    /// [`Mode::Force`] may already have emptied the ledgers.
    pub fn open<E: Into<Box<dyn Error + Send + Sync>>>(
        dir: &Path,
        request: JobRequest,
        resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
    ) -> Result<Self, JobError> {
        let dir = named(dir);
        check_request(&request)?;
        fs::create_dir_all(dir).map_err(|e| JobError::io(dir, "creating the directory", e))?;
        let mut writer = LedgerWriter::open(dir, &request.worker)?;
        clean(dir, &request)?;
        if request.mode == Mode::Force {
            start_over(dir, &mut writer)?;
        }
        let old = Plan::load(dir)?;
        let ledger = Ledger::read(dir)?;
        writer.cut_torn_line()?;
        let selected = select(&request);
        let state = match old {
            None => begin(dir, &request, ledger, resolve)?,
            Some(plan) => go_on(
                JobState::new(dir, plan, ledger),
                &request,
                &selected,
                resolve,
            )?,
        };
        Ok(Self {
            state,
            writer,
            selected,
        })
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
        let mut entry = self.state.ledger.next_entry(frame, Status::Done, &details);
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
        let mut entry = self
            .state
            .ledger
            .next_entry(frame, Status::Failed, &details);
        entry.reason = Some(reason.to_owned());
        self.record(entry, FrameState::Failed)
    }

    fn record(&mut self, entry: Entry, state: FrameState) -> Result<(), JobError> {
        let frame = entry.frame;
        let Some(slot) = self.state.states.get_mut(&frame) else {
            return Err(JobError::Request(format!(
                "frame {frame} is not in the plan"
            )));
        };
        self.writer.append(&entry)?;
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
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<JobState, JobError> {
    refuse_ledgers(dir)?;
    let mut plan = new_plan(dir, request, Value::Null)?;
    plan.resolve(resolve(None).map_err(|e| JobError::Resolve(e.into()))?);
    plan.store(dir)?;
    Ok(JobState::new(dir, plan, ledger))
}

/// Refuses ledgers that no plan explains.
fn refuse_ledgers(dir: &Path) -> Result<(), JobError> {
    match ledger_files(dir)?.into_iter().find(|(_, len)| *len > 0) {
        Some((ledger, _)) => Err(JobError::PlanMissing { ledger }),
        None => Ok(()),
    }
}

fn new_plan(dir: &Path, request: &JobRequest, resolved: Value) -> Result<Plan, JobError> {
    let mut frames = plan_frames(dir, request.frames.iter())?;
    frames.sort_by_key(|f| f.number);
    Ok(Plan::new(request.settings.clone(), resolved, frames))
}

fn go_on<E: Into<Box<dyn Error + Send + Sync>>>(
    state: JobState,
    request: &JobRequest,
    selected: &[i64],
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<JobState, JobError> {
    let plan = merged_plan(&state, request, selected, resolve)?;
    if plan != state.plan {
        plan.store(&state.dir)?;
    }
    Ok(JobState::new(&state.dir, plan, state.ledger))
}

/// Frames outside the selection that the plan knows are not looked at again, so that one of many
/// runs over a long sequence reads only its own inputs.
fn merged_plan<E: Into<Box<dyn Error + Send + Sync>>>(
    state: &JobState,
    request: &JobRequest,
    selected: &[i64],
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<Plan, JobError> {
    let dir = state.dir.clone();
    let changes = state.plan.changes_to(&request.settings);
    if request.mode == Mode::Resume && !changes.is_empty() {
        return Err(JobError::SettingsChanged { dir, changes });
    }
    let selected: HashSet<i64> = selected.iter().copied().collect();
    let to_plan = request
        .frames
        .iter()
        .filter(|f| selected.contains(&f.number) || state.plan.frame(f.number).is_none());
    let frames = plan_frames(&dir, to_plan)?;
    if request.mode == Mode::Resume {
        let changes = changed_inputs(state, &frames);
        if !changes.is_empty() {
            return Err(JobError::InputChanged { dir, changes });
        }
    }
    let resolved = if changes.is_empty() {
        state.plan.resolved().clone()
    } else {
        resolve(Some(state.plan.resolved())).map_err(|e| JobError::Resolve(e.into()))?
    };
    let settings = if changes.is_empty() {
        state.plan.settings().to_vec()
    } else {
        request.settings.clone()
    };
    let mut plan = Plan::new(settings, resolved, state.plan.frames().to_vec());
    plan.merge(frames);
    Ok(plan)
}

/// Only finished frames can be stale; the others will be made from what is there now.
fn changed_inputs(state: &JobState, frames: &[PlannedFrame]) -> Vec<InputChange> {
    let mut changes: Vec<InputChange> = frames
        .iter()
        .filter(|now| state.is_done(now.number))
        .filter_map(|now| {
            let (path, what) = state.plan.frame(now.number)?.changed_input(now)?;
            Some(InputChange {
                frame: now.number,
                path,
                what,
            })
        })
        .collect();
    changes.sort_by_key(|c| c.frame);
    changes
}

/// Takes fingerprints; a file that many frames share is read once.
fn plan_frames<'a>(
    dir: &Path,
    frames: impl Iterator<Item = &'a FrameRequest>,
) -> Result<Vec<PlannedFrame>, JobError> {
    let mut known: HashMap<&Path, Option<Fingerprint>> = HashMap::new();
    let mut planned = Vec::new();
    for frame in frames {
        let mut inputs = Vec::with_capacity(frame.inputs.len());
        for path in &frame.inputs {
            let fingerprint = known
                .entry(path)
                .or_insert_with(|| Fingerprint::of_file(path).ok());
            inputs.push(PlannedInput {
                path: utf8(path)?,
                fingerprint: fingerprint.clone(),
            });
        }
        let outputs = frame.outputs.iter().map(|path| stored_path(dir, path));
        planned.push(PlannedFrame {
            number: frame.number,
            inputs,
            outputs: outputs.collect::<Result<_, _>>()?,
        });
    }
    Ok(planned)
}

fn select(request: &JobRequest) -> Vec<i64> {
    let all: Vec<i64> = request.frames.iter().map(|f| f.number).collect();
    match &request.selection {
        Some(range) => range.select(&all),
        None => all,
    }
}

fn check_request(request: &JobRequest) -> Result<(), JobError> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    if request.worker.is_empty() || !request.worker.chars().all(is_plain) {
        let what = format!(
            "worker `{}`: a name may have letters, digits, `-`, `_` and `.`",
            request.worker
        );
        return Err(JobError::Request(what));
    }
    let mut numbers = HashSet::new();
    let mut outputs = HashMap::new();
    for frame in &request.frames {
        if !numbers.insert(frame.number) {
            let what = format!("frame {} is there twice", frame.number);
            return Err(JobError::Request(what));
        }
        for path in &frame.outputs {
            if let Some(other) = outputs.insert(path, frame.number) {
                let what = format!(
                    "{}: frames {other} and {} would both be written here; put #### into the output's name",
                    path.display(),
                    frame.number
                );
                return Err(JobError::Request(what));
            }
        }
    }
    Ok(())
}

/// Ledgers go first: a plan without them means nothing is done, they without it could be taken
/// for words on the next plan.
fn start_over(dir: &Path, writer: &mut LedgerWriter) -> Result<(), JobError> {
    writer.start_over(dir)?;
    let path = Plan::path_in(dir);
    match fs::remove_file(&path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => {
            Err(JobError::io(&path, "removing the plan", e))
        }
        _ => Ok(()),
    }
}

/// Removes what killed runs left half written, here and where outputs go.
fn clean(dir: &Path, request: &JobRequest) -> Result<(), JobError> {
    let outputs = request.frames.iter().flat_map(|f| &f.outputs);
    let mut dirs: Vec<&Path> = outputs.filter_map(|path| path.parent()).collect();
    dirs.push(dir);
    dirs.sort_unstable();
    dirs.dedup();
    for dir in dirs {
        match remove_leftovers(dir) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                return Err(JobError::io(dir, "removing leftovers of a killed run", e));
            }
            _ => {}
        }
    }
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

/// Relative to `dir` where it can be, so that the directory may be moved.
fn stored_path(dir: &Path, path: &Path) -> Result<String, JobError> {
    let failed = |e| JobError::io(path, "finding its absolute path", e);
    let path = std::path::absolute(path).map_err(failed)?;
    let dir = std::path::absolute(dir).map_err(failed)?;
    utf8(path.strip_prefix(dir).unwrap_or(&path))
}

fn utf8(path: &Path) -> Result<String, JobError> {
    path.to_str().map(str::to_owned).ok_or_else(|| {
        JobError::Request(format!(
            "{}: the name is not UTF-8 and cannot go into a plan; rename it",
            path.display()
        ))
    })
}
