//! Renders each frame in a process of its own. A crash, or a kill because memory ran out, then costs one frame.
//!
//! The process writes the image. The parent does everything else: claims, ledger, reports, and removing the temporary
//! files of a process that died.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use spherule_formats::Sequence;
use spherule_jobs::{
    ClaimedFrame, FailureKind, FinishedFrame, FrameFailure, FrameWork, RunContext, discard_parts,
    owner, set_owner,
};

use super::{ChildCommand, ChildResult, Crash, JobManifest, RenderJob, RunError};
use crate::manifest::Manifest;
use crate::pipeline::{ImageError, ImageTask, WriteError, gpu, make_image};
use crate::render::RenderError;
use crate::report::FrameReport;

/// The task of a child process, one line of JSON on its standard input.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct IsolatedTask {
    /// The owner of its temporary files.
    owner: String,
    /// The directory of the images, which paths in the manifest are relative to.
    dir: PathBuf,
    /// The manifest, as TOML.
    manifest: String,
    /// See [`Manifest::has_opaque_previews`].
    has_opaque_previews: bool,
    /// The resolved automatic settings.
    resolved: Value,
    frame: i64,
    /// Limit of anonymous memory, bytes.
    ceiling: Option<u64>,
    /// Number of threads; None for the default.
    pub threads: Option<u32>,
    /// The number of the GPU that the user chose.
    gpu: Option<usize>,
}

/// The result of a child process, one line of JSON on its standard output.
#[derive(Debug, Serialize, Deserialize)]
pub struct IsolatedResult(Outcome);

#[derive(Debug, Serialize, Deserialize)]
enum Outcome {
    Done {
        report: Box<FrameReport>,
        notes: Vec<String>,
    },
    Failed {
        kind: FailureKind,
        reason: String,
    },
    /// The frame is no longer in the sequence.
    Missing,
    /// A file cannot be written: the file and the error number of the system.
    Unwritable(PathBuf, Option<i32>),
}

/// Called in the child process: renders the frame of `task`.
///
/// # Errors
/// The frame cannot be rendered because of the job, not of the frame.
pub fn render_task(task: IsolatedTask) -> Result<IsolatedResult, RunError> {
    set_owner(&task.owner);
    if let Some(number) = task.gpu {
        gpu::choose(number);
    }
    if let Some(ceiling) = task.ceiling {
        limit_memory(ceiling).map_err(RunError::MemoryCeiling)?;
    }
    render(task).map(IsolatedResult)
}

fn render(task: IsolatedTask) -> Result<Outcome, RunError> {
    // Set up the image as the parent did, from the stored settings
    let mut manifest = Manifest::parse(&task.manifest, &task.dir.join("job.toml"))?;
    manifest.has_opaque_previews = task.has_opaque_previews;
    let manifest = JobManifest::new(manifest, task.dir);
    let sequence = manifest.open_sequence()?;
    let render_job = RenderJob::new(manifest, &sequence, None)?;
    let (_, setup) = render_job.stored_setup(&task.resolved, &sequence)?;
    let images = render_job.tasks(&sequence, &[task.frame]);
    let Some(image) = images.first() else {
        return Ok(Outcome::Missing);
    };
    // Render it; errors travel to the parent as text
    let mut notes = Vec::new();
    Ok(match make_image(&setup, &sequence, image, |note| notes.push(note)) {
        Ok(report) => Outcome::Done { report: Box::new(report), notes },
        Err(ImageError::Write(WriteError::Io { path, source })) => {
            Outcome::Unwritable(path, source.raw_os_error())
        }
        Err(error) => {
            let failure = error.into_failure(task.frame);
            Outcome::Failed { kind: failure.kind, reason: failure.to_string() }
        }
    })
}

/// Renders the frames of a job in child processes.
pub(super) struct IsolatedRender<'a> {
    pub(super) render_job: &'a RenderJob,
    pub(super) sequence: &'a Sequence,
    pub(super) images: &'a [ImageTask],
    pub(super) resolved: Value,
    pub(super) command: &'a ChildCommand,
}

impl FrameWork for IsolatedRender<'_> {
    type Report = FrameReport;

    fn process(
        &self,
        frame: &ClaimedFrame,
        context: &RunContext<'_, FrameReport>,
    ) -> Result<FinishedFrame<FrameReport>, FrameFailure> {
        // Refuse a frame that does not fit into memory
        let (image, number) = (&self.images[frame.index], frame.frame);
        context.report_stage(number, "rendering");
        if let Some(error) = &image.refused {
            return Err(ImageError::from(error.clone()).into_failure(number));
        }
        // Render it in a child process, and discard what a dead child leaves
        let start = Instant::now();
        let stop = || context.interrupt().stop_now();
        let failure = |kind, source| {
            discard(image);
            Err(FrameFailure { kind, frame: number, source })
        };
        match self.command.run(&self.task(number), stop) {
            ChildResult::Completed(IsolatedResult(outcome)) => {
                self.finished(image, outcome, start, context)
            }
            ChildResult::Crashed(crash) => failure(FailureKind::Crash, self.explained(crash)),
            ChildResult::Interrupted => {
                failure(FailureKind::Interrupted, RenderError::Interrupted.into())
            }
        }
    }
}

impl IsolatedRender<'_> {
    fn task(&self, frame: i64) -> IsolatedTask {
        let manifest = self.render_job.manifest();
        IsolatedTask {
            owner: owner().to_owned(),
            dir: self.render_job.dir().to_owned(),
            manifest: manifest.to_commented_toml(),
            has_opaque_previews: manifest.has_opaque_previews,
            resolved: self.resolved.clone(),
            frame,
            ceiling: manifest.job.memory_ceiling.map(|limit| limit.0),
            threads: manifest.job.threads,
            gpu: gpu::chosen(),
        }
    }

    /// The reason of a crash, with the remedy if memory was limited.
    fn explained(&self, crash: Crash) -> Box<dyn Error + Send + Sync> {
        match (&crash, self.render_job.manifest().job.memory_ceiling) {
            (Crash::OutOfMemory(_), Some(ceiling)) => {
                format!("{crash}; raise job.memory_ceiling, which is {ceiling}").into()
            }
            _ => crash.into(),
        }
    }

    fn finished(
        &self,
        image: &ImageTask,
        outcome: Outcome,
        start: Instant,
        context: &RunContext<'_, FrameReport>,
    ) -> Result<FinishedFrame<FrameReport>, FrameFailure> {
        let frame = image.frame;
        match outcome {
            Outcome::Done { mut report, notes } => {
                context.report_notes(notes);
                report.seconds.wall = start.elapsed().as_secs_f64();
                Ok(FinishedFrame { outputs: image.outputs(), report: *report })
            }
            Outcome::Failed { kind, reason } => Err(FrameFailure::new(kind, frame, reason)),
            Outcome::Missing => {
                let error = MissingFrame::new(self.sequence, image.index);
                Err(FrameFailure::new(FailureKind::Frame, frame, error))
            }
            Outcome::Unwritable(path, number) => Err(unwritable(frame, &path, number)),
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
    fn new(sequence: &Sequence, index: usize) -> Self {
        let inputs = sequence.inputs(index).into_iter();
        let paths = inputs.map(|path| path.display().to_string()).collect();
        Self { paths }
    }
}

fn unwritable(frame: i64, path: &Path, number: Option<i32>) -> FrameFailure {
    let unknown = || io::Error::other("the file cannot be written");
    let source = number.map_or_else(unknown, io::Error::from_raw_os_error);
    FrameFailure::writing(frame, path, source)
}

/// Removes the temporary files of a process that died. The next run finds those that remain.
fn discard(image: &ImageTask) {
    for path in image.outputs() {
        let _ = discard_parts(&path, owner());
    }
}

/// Limits the anonymous memory of this process to `bytes`. Further allocations fail.
#[cfg(unix)]
fn limit_memory(bytes: u64) -> io::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let old = getrlimit(Resource::Data);
    let maximum = old.maximum;
    let current = Some(maximum.map_or(bytes, |most| bytes.min(most)));
    Ok(setrlimit(Resource::Data, Rlimit { current, maximum })?)
}

#[cfg(not(unix))]
fn limit_memory(_bytes: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}
