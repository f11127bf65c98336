//! `--isolate`: renders each frame in a process of its own. A crash, or a kill because memory ran out, then costs
//! one frame.
//!
//! The process is this program with a hidden command. It writes the image. The parent does everything else: claims,
//! ledger, reports, and removing the temporary files of a process that died.

use std::io;
use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use spherule_jobs::{
    FailureKind, FrameFailure, FrameQueue, Interrupt, Job, JobError, QueueEvent, discard_parts,
    owner, set_owner,
};

use crate::cli::child::{self, ChildResult};
use crate::cli::job::use_threads;
use crate::cli::manifest_args::RequestedManifest;
use crate::cli::render_job::RenderJob;
use crate::cli::{CliError, Outcome, print};
use crate::manifest::Manifest;
use crate::pipeline::{Event, ImageError, ImageTask, OnEvent, Stage, WriteError, make_image};
use crate::render::RenderError;
use crate::report::FrameReport;

/// The hidden command of the process.
pub(in crate::cli) const COMMAND: &str = "render-frame";

/// The task of a process.
#[derive(Debug, Serialize, Deserialize)]
struct IsolatedTask {
    /// The owner of its temporary files.
    owner: String,
    /// The directory of the images, which paths in the manifest are relative to.
    dir: PathBuf,
    /// The manifest, as TOML.
    manifest: String,
    /// The resolved automatic settings.
    resolved: Value,
    frame: i64,
    /// Limit of anonymous memory, bytes.
    ceiling: Option<u64>,
}

/// The result of a process.
#[derive(Debug, Serialize, Deserialize)]
enum IsolatedResult {
    Done {
        report: Box<FrameReport>,
        notes: Vec<String>,
    },
    /// The frame failed.
    Failed { kind: FailureKind, reason: String },
    /// The frame is no longer in the sequence.
    Missing,
    /// A file cannot be written: the file and the error number of the system.
    Unwritable(PathBuf, Option<i32>),
}

/// Renders frames in child processes.
pub(super) struct IsolatedRender<'a> {
    pub(super) render_job: &'a RenderJob,
    pub(super) tasks: &'a [ImageTask],
}

impl IsolatedRender<'_> {
    /// Renders the tasks that no other worker holds, one after the other, and records them in `job`.
    pub(super) fn run(
        &self,
        job: &mut Job,
        interrupt: &Interrupt,
        on_event: OnEvent,
    ) -> Result<(), JobError> {
        let frames = self.tasks.iter().map(|task| task.frame);
        let mut queue = FrameQueue::new(job.claims(), frames, interrupt);
        let mut on_queue_event = |event: QueueEvent| on_event(Event::OtherWorker(event));
        let attempts = self.render_job.manifest.job.retries + 1;
        while let Some((index, claim)) = queue.next(&mut on_queue_event)? {
            let task = &self.tasks[index];
            on_event(Event::StageEntered(task.frame, Stage::Trace));
            for attempt in 1..=attempts {
                match self.render(task, job, interrupt, on_event) {
                    Ok(report) => {
                        job.record_done(task.frame, &outputs(task), json!(report))?;
                        on_event(Event::Done(task, &report));
                        break;
                    }
                    Err(failure) if failure.kind == FailureKind::Interrupted => return Ok(()),
                    Err(failure) if failure.kind.stops_run() => {
                        return Err(JobError::Stopped(failure));
                    }
                    Err(failure) => {
                        job.record_failed(&failure)?;
                        if failure.kind.is_retryable() && attempt < attempts {
                            let note = format!(
                                "frame {}: attempt {attempt} of {attempts} failed: {failure}",
                                task.frame
                            );
                            on_event(Event::Note(&note));
                        } else {
                            on_event(Event::Failed(&failure));
                            break;
                        }
                    }
                }
            }
            claim.complete();
        }
        Ok(())
    }

    /// Renders one frame in a child process.
    fn render(
        &self,
        task: &ImageTask,
        job: &Job,
        interrupt: &Interrupt,
        on_event: OnEvent,
    ) -> Result<FrameReport, FrameFailure> {
        let frame = task.frame;
        if let Some(error) = &task.refused {
            return Err(ImageError::from(error.clone()).into_failure(frame));
        }
        let start = Instant::now();
        let child_task = self.isolated_task(task, job.resolved());
        let result = match child::run(COMMAND, &child_task, || interrupt.stop_now()) {
            ChildResult::Completed(result) => result,
            ChildResult::Crashed(crash) => {
                discard(task);
                return Err(FrameFailure::new(FailureKind::Crash, frame, crash));
            }
            ChildResult::Interrupted => {
                discard(task);
                return Err(FrameFailure::new(
                    FailureKind::Interrupted,
                    frame,
                    RenderError::Interrupted,
                ));
            }
        };
        match result {
            IsolatedResult::Done { mut report, notes } => {
                notes.iter().for_each(|note| on_event(Event::Note(note)));
                report.seconds.wall = start.elapsed().as_secs_f64();
                Ok(*report)
            }
            IsolatedResult::Failed { kind, reason } => Err(FrameFailure::new(kind, frame, reason)),
            IsolatedResult::Missing => {
                let error = MissingFrame::new(job, frame);
                Err(FrameFailure::new(FailureKind::Frame, frame, error))
            }
            IsolatedResult::Unwritable(path, number) => {
                let unknown = || io::Error::other("the file cannot be written");
                let source = number.map_or_else(unknown, io::Error::from_raw_os_error);
                Err(FrameFailure::writing(frame, &path, source))
            }
        }
    }

    fn isolated_task(&self, task: &ImageTask, resolved: &Value) -> IsolatedTask {
        IsolatedTask {
            owner: owner().to_owned(),
            dir: self.render_job.dir.clone(),
            manifest: self.render_job.manifest.to_commented_toml(),
            resolved: resolved.clone(),
            frame: task.frame,
            ceiling: self
                .render_job
                .manifest
                .job
                .memory_ceiling
                .map(|limit| limit.0),
        }
    }
}

/// The files of a frame were removed after the job was planned.
#[derive(Debug, thiserror::Error)]
#[error("{}: removed since the job was planned", paths.join(", "))]
struct MissingFrame {
    paths: Vec<String>,
}

impl MissingFrame {
    fn new(job: &Job, frame: i64) -> Self {
        let planned = job.state().plan().frame(frame);
        let inputs = planned.map_or(&[][..], |planned| &planned.inputs);
        let paths = inputs.iter().map(|input| input.path.clone()).collect();
        Self { paths }
    }
}

fn outputs(task: &ImageTask) -> Vec<PathBuf> {
    let image = std::iter::once(&task.image);
    image.chain(&task.preview).cloned().collect()
}

/// Removes the temporary files of a process that died. The next run finds those that remain.
fn discard(task: &ImageTask) {
    for path in outputs(task) {
        let _ = discard_parts(&path, owner());
    }
}

/// The main function of the child process.
pub(in crate::cli) fn run_child() -> Result<Outcome, CliError> {
    let request: IsolatedTask = child::read_task("render --isolate")?;
    set_owner(&request.owner);
    if let Some(ceiling) = request.ceiling {
        limit_memory(ceiling)?;
    }
    let result = render(request)?;
    let text = serde_json::to_string(&result).map_err(|e| CliError::Other(e.to_string()))?;
    print::file(&(text + "\n"))?;
    Ok(Outcome::Done)
}

fn render(request: IsolatedTask) -> Result<IsolatedResult, CliError> {
    let manifest = Manifest::parse(&request.manifest, &request.dir.join("job.toml"))?;
    use_threads(manifest.job.threads)?;
    let requested = RequestedManifest {
        manifest,
        base: request.dir,
        file: None,
        unchanged: None,
    };
    let sequence = requested.sequence()?;
    let render_job = RenderJob::new(requested, &sequence, None)?;
    let (_, setup) = render_job.stored_setup(&request.resolved, &sequence)?;
    let tasks = render_job.tasks(&sequence, &[request.frame]);
    let Some(task) = tasks.first() else {
        return Ok(IsolatedResult::Missing);
    };
    let mut notes = Vec::new();
    let rendered = make_image(&setup, &sequence, task, |note| notes.push(note.to_owned()));
    Ok(match rendered {
        Ok(report) => IsolatedResult::Done {
            report: Box::new(report),
            notes,
        },
        Err(ImageError::Write(WriteError::Io { path, source })) => {
            IsolatedResult::Unwritable(path, source.raw_os_error())
        }
        Err(error) => {
            let failure = error.into_failure(request.frame);
            IsolatedResult::Failed {
                kind: failure.kind,
                reason: failure.to_string(),
            }
        }
    })
}

/// Limits the anonymous memory of this process to `bytes`. Further allocations fail.
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
