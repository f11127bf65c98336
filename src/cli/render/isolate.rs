//! `--isolate`: each frame in a process of its own, so that a crash, or the system's killing what takes too
//! much memory, costs one frame.
//!
//! The process is this program again under a hidden command. It makes the image; claims, ledger and
//! reports are its parent's, and so are its temporary files, should it die.

use std::io;
use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use spherule_jobs::{
    Interrupt, Job, JobError, Queue, QueueNews, discard_parts, owner, work_on_behalf_of,
};

use crate::cli::child::{self, Ended};
use crate::cli::job::Asked;
use crate::cli::plan::Plan;
use crate::cli::work::use_threads;
use crate::cli::{CliError, Outcome, print};
use crate::manifest::Manifest;
use crate::pipeline::{Event, ImageTask, SingleFault, Stage, Watch, make_image};
use crate::report::FrameReport;

/// The command of the process, which users are not told of.
pub(in crate::cli) const COMMAND: &str = "render-frame";

/// What a process is to do.
#[derive(Debug, Serialize, Deserialize)]
struct FrameRequest {
    /// Whose its temporary files are.
    owner: String,
    /// Where the images go, and paths in the manifest begin.
    dir: PathBuf,
    /// The manifest, as TOML.
    manifest: String,
    /// What "auto" turned into.
    resolved: Value,
    frame: i64,
    /// Most anonymous memory, bytes.
    ceiling: Option<u64>,
}

/// What came of it.
#[derive(Debug, Serialize, Deserialize)]
enum Told {
    Done {
        report: Box<FrameReport>,
        notes: Vec<String>,
    },
    Failed(String),
    /// The frame is not in the sequence any more.
    Gone,
    /// The file, and the number of the system's error.
    Place(PathBuf, Option<i32>),
}

/// Frames to be made.
pub(super) struct Work<'a> {
    pub(super) plan: &'a Plan,
    pub(super) tasks: &'a [ImageTask],
}

impl Work<'_> {
    /// Makes those of the tasks that no other worker does, one after the other, and records each in `job`.
    pub(super) fn run(
        &self,
        job: &mut Job,
        interrupt: &Interrupt,
        watch: Watch,
    ) -> Result<(), JobError> {
        let frames = self.tasks.iter().map(|task| task.frame);
        let mut queue = Queue::new(job.claims(), frames, interrupt);
        let mut heard = |news: QueueNews| watch(Event::Others(news));
        while let Some((place, claim)) = queue.take(&mut heard)? {
            let task = &self.tasks[place];
            watch(Event::Entered(task.frame, Stage::Trace));
            if !self.make(task, job, interrupt, watch)? {
                return Ok(());
            }
            claim.end();
        }
        Ok(())
    }

    /// Tries to make one frame as often as asked for; false if it was given up for an interrupt.
    fn make(
        &self,
        task: &ImageTask,
        job: &mut Job,
        interrupt: &Interrupt,
        watch: Watch,
    ) -> Result<bool, JobError> {
        if let Some(reason) = &task.refused {
            fail(job, watch, task, reason)?;
            return Ok(true);
        }
        let tries = self.plan.manifest.job.retries + 1;
        let request = self.request(task, job.resolved());
        for attempt in 1..=tries {
            let start = Instant::now();
            match child::run(COMMAND, &request, || interrupt.stop_now()) {
                Ended::Interrupted => {
                    discard(task);
                    return Ok(false);
                }
                Ended::Told(Told::Done { mut report, notes }) => {
                    for note in &notes {
                        watch(Event::Note(note));
                    }
                    report.seconds.wall = start.elapsed().as_secs_f64();
                    job.record_done(task.frame, &outputs(task), json!(report))?;
                    watch(Event::Done(task, &report));
                    return Ok(true);
                }
                Ended::Told(Told::Gone) => {
                    fail(job, watch, task, &gone(job, task.frame))?;
                    return Ok(true);
                }
                Ended::Told(Told::Failed(reason)) => {
                    fail(job, watch, task, &reason)?;
                    return Ok(true);
                }
                Ended::Told(Told::Place(path, number)) => {
                    let unknown = || io::Error::other("the file cannot be written");
                    let source = number.map_or_else(unknown, io::Error::from_raw_os_error);
                    return Err(JobError::writing(&path, source));
                }
                Ended::Died(reason) => {
                    discard(task);
                    let reason = format!("its process died (try {attempt} of {tries}): {reason}");
                    if attempt == tries {
                        fail(job, watch, task, &reason)?;
                    } else {
                        watch(Event::Note(&format!("frame {}: {reason}", task.frame)));
                        job.record_failed(task.frame, &reason, json!(null))?;
                    }
                }
            }
        }
        Ok(true)
    }

    fn request(&self, task: &ImageTask, resolved: &Value) -> FrameRequest {
        FrameRequest {
            owner: owner().to_owned(),
            dir: self.plan.dir.clone(),
            manifest: self.plan.manifest.to_commented_toml(),
            resolved: resolved.clone(),
            frame: task.frame,
            ceiling: self.plan.manifest.job.memory_ceiling.map(|limit| limit.0),
        }
    }
}

fn fail(job: &mut Job, watch: Watch, task: &ImageTask, reason: &str) -> Result<(), JobError> {
    watch(Event::Failed(task.frame, reason));
    job.record_failed(task.frame, reason, json!(null))
}

/// That the files of `frame` are not there any more.
fn gone(job: &Job, frame: i64) -> String {
    let planned = job.state().plan().frame(frame);
    let inputs = planned.map_or(&[][..], |planned| &planned.inputs);
    let paths: Vec<&str> = inputs.iter().map(|input| input.path.as_str()).collect();
    format!("{}: is gone since the job was planned", paths.join(", "))
}

fn outputs(task: &ImageTask) -> Vec<PathBuf> {
    let image = std::iter::once(&task.image);
    image.chain(&task.preview).cloned().collect()
}

/// Clears away what a process that has died was writing. What stays is found by the next run.
fn discard(task: &ImageTask) {
    for path in outputs(task) {
        let _ = discard_parts(&path, owner());
    }
}

/// The child's side.
pub(in crate::cli) fn run_child() -> Result<Outcome, CliError> {
    let request: FrameRequest = child::task("render --isolate")?;
    work_on_behalf_of(&request.owner);
    if let Some(ceiling) = request.ceiling {
        limit_memory(ceiling)?;
    }
    let told = told(request)?;
    let text = serde_json::to_string(&told).map_err(|e| CliError::Other(e.to_string()))?;
    print::file(&(text + "\n"))?;
    Ok(Outcome::Done)
}

fn told(request: FrameRequest) -> Result<Told, CliError> {
    let manifest = Manifest::parse(&request.manifest, &request.dir.join("job.toml"))?;
    use_threads(manifest.job.threads)?;
    let asked = Asked {
        manifest,
        base: request.dir,
        file: None,
        unchanged: None,
    };
    let sequence = asked.sequence()?;
    let plan = Plan::new(asked, &sequence, None)?;
    let (_, setup) = plan.settle(&request.resolved, &sequence)?;
    let tasks = plan.tasks(&sequence, &[request.frame]);
    let Some(task) = tasks.first() else {
        return Ok(Told::Gone);
    };
    let mut notes = Vec::new();
    let made = make_image(&setup, &sequence, task, |note| notes.push(note.to_owned()));
    Ok(match made {
        Ok(report) => Told::Done {
            report: Box::new(report),
            notes,
        },
        Err(SingleFault::Frame(reason)) => Told::Failed(reason),
        Err(SingleFault::Place(path, error)) => Told::Place(path, error.raw_os_error()),
    })
}

/// No more than `bytes` of this process's own memory: what asks for more fails.
#[cfg(unix)]
fn limit_memory(bytes: u64) -> Result<(), CliError> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let old = getrlimit(Resource::Data);
    let maximum = old.maximum;
    let current = Some(maximum.map_or(bytes, |most| bytes.min(most)));
    setrlimit(Resource::Data, Rlimit { current, maximum })
        .map_err(|e| CliError::other(format!("job.memory_ceiling: {e}")))
}

#[cfg(not(unix))]
fn limit_memory(_bytes: u64) -> Result<(), CliError> {
    Err(CliError::other("job.memory_ceiling: not on this system"))
}
