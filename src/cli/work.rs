//! What the commands that work as jobs have in common: how an earlier run is gone on with, where the
//! files go, and how the end is told.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};
use spherule_formats::Sequence;
use spherule_jobs::{FrameRange, FrameRequest, Interrupt, Job, JobError, Mode, PLAN_FILE};

use super::job::{is_manifest, read_manifest};
use super::paths::absolute;
use super::progress::{Ended, duration};
use super::shard::Shard;
use super::{CliError, Outcome, events};
use crate::manifest::{Manifest, real_dir};
use crate::survey::Survey;

/// The setting that says what a job makes; jobs that render have none.
pub(super) const KIND: &str = "job";

/// What one run does with what is there. No manifest says such things: one that always starts over would
/// throw finished work away.
#[derive(Debug, Args)]
#[command(next_help_heading = "Job")]
pub(super) struct WorkArgs {
    /// Start over, whatever was made here before.
    #[arg(long)]
    pub(super) force: bool,
    /// Keep finished frames although settings or inputs have changed.
    #[arg(long, conflicts_with = "force")]
    pub(super) keep_done: bool,
    /// Do one part of the frames only: 2/4 is the second of four.
    ///
    /// Workers at the same job share its frames without this, too.
    #[arg(long, value_name = "I/N", allow_hyphen_values = true)]
    pub(super) shard: Option<Shard>,
}

impl WorkArgs {
    /// What to do with what an earlier run left.
    pub(super) const fn mode(&self) -> Mode {
        match (self.force, self.keep_done) {
            (true, _) => Mode::Force,
            (_, true) => Mode::KeepDone,
            _ => Mode::Resume,
        }
    }
}

/// Threads for each processor that are of any use. With far more, they keep one another from working: 2000 on two
/// processors need minutes for what two do in milliseconds.
const THREADS_PER_PROCESSOR: usize = 4;

/// Uses as many threads as asked for from now on; None leaves it to the machine.
pub(super) fn use_threads(threads: Option<u32>) -> Result<(), CliError> {
    let Some(count) = threads.and_then(|t| usize::try_from(t).ok()) else {
        return Ok(());
    };
    let count = useful_threads(count);
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build_global()
        .map_err(|e| CliError::other(format!("{count} threads: {e}")))
}

/// `asked` threads, or as many as this machine has any use for.
pub(super) fn useful_threads(asked: usize) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let most = processors.saturating_mul(THREADS_PER_PROCESSOR);
    if asked > most {
        note!(
            "--threads {asked}: {most} are used, {THREADS_PER_PROCESSOR} for each of {processors} processors"
        );
    }
    asked.min(most)
}

/// The frames that `range` has of `sequence`, or all; `shown` is what the range was given by.
pub(super) fn chosen(
    sequence: &Sequence,
    range: Option<&FrameRange>,
    shown: &str,
) -> Result<Vec<i64>, CliError> {
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    let Some(range) = range else {
        return Ok(numbers);
    };
    let chosen = range.select(&numbers);
    if chosen.is_empty() {
        return Err(CliError::other(format!(
            "{shown}: {range} has none of the frames that there are: {}",
            list(&numbers)
        )));
    }
    Ok(chosen)
}

/// The numbers of the frames to do: those of `range` and of the shard.
pub(super) fn selection(
    sequence: &Sequence,
    range: Option<&FrameRange>,
    shard: Option<Shard>,
) -> Vec<i64> {
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    let chosen = range.map_or_else(|| numbers.clone(), |range| range.select(&numbers));
    shard.map_or_else(|| chosen.clone(), |shard| shard.of(&chosen))
}

/// All frames of `sequence`, made into `outputs` of their number.
pub(super) fn requests(
    sequence: &Sequence,
    outputs: impl Fn(i64) -> Vec<PathBuf>,
) -> Vec<FrameRequest> {
    let request = |(index, number)| FrameRequest {
        number,
        inputs: sequence
            .inputs(index)
            .into_iter()
            .map(Path::to_owned)
            .collect(),
        outputs: outputs(number),
    };
    let numbers = sequence.frames().iter().map(|frame| frame.number);
    numbers.enumerate().map(request).collect()
}

/// Refuses a directory that cannot be because a file is in its place; `what` is to go there.
pub(super) fn guard_directory(dir: &Path, what: &str) -> Result<(), CliError> {
    match dir.ancestors().find(|p| p.exists()) {
        Some(found) if !found.is_dir() => Err(CliError::other(format!(
            "{}: is a file where a directory for the {what} should be; choose another output",
            found.display()
        ))),
        _ => Ok(()),
    }
}

/// Refuses a directory whose job makes something else; `kind` is the value of [`KIND`], if any.
pub(super) fn guard_kind(dir: &Path, kind: Option<&str>, mode: Mode) -> Result<(), CliError> {
    if mode == Mode::Force {
        return Ok(());
    }
    let Some(plan) = Job::peek(dir)? else {
        return Ok(());
    };
    let mut settings = plan.settings().iter();
    let found = settings.find(|(key, _)| key == KIND).map(|(_, v)| &v[..]);
    if found == kind {
        return Ok(());
    }
    let what = |kind: Option<&str>| kind.unwrap_or("render").to_owned();
    Err(CliError::other(format!(
        "{}: holds a job of `{}`, not of `{}`; choose another directory, or forget that job with --force",
        dir.display(),
        what(found),
        what(kind)
    )))
}

/// The directory of the job that a user names by it or by a manifest.
pub(super) fn job_directory(job: &Path) -> Result<PathBuf, CliError> {
    if !is_manifest(job) || job.is_dir() {
        return Ok(job.to_owned());
    }
    let text = read_manifest(job)?;
    let manifest = Manifest::parse(&text, job)?;
    let base = absolute(job.parent().unwrap_or(Path::new("")))?;
    Ok(real_dir(&base.join(manifest.output.path.dir())))
}

/// There is no job in `dir`.
pub(super) fn no_job(dir: &Path) -> CliError {
    CliError::other(format!(
        "{}: no job here (no {PLAN_FILE}); name the directory of its images, or its job.toml",
        dir.display()
    ))
}

/// What was found when the job in `dir` began.
pub(super) fn saved_survey(resolved: &Value, dir: &Path) -> Result<Survey, CliError> {
    serde_json::from_value(resolved.clone()).map_err(|e| {
        CliError::other(format!(
            "{}: its resolved values cannot be read ({e}); start over with --force",
            dir.join(PLAN_FILE).display()
        ))
    })
}

/// Tells how many frames of the run are done before it begins.
pub(super) fn tell_kept(job: &Job, tasks: usize) {
    let selected = job.selected().len();
    if selected > tasks {
        say!("{} of {selected} frames are done already", selected - tasks);
    }
}

/// A run that is over.
pub(super) struct Finished<'a> {
    pub(super) job: &'a Job,
    /// Frames that it was to make.
    pub(super) tasks: usize,
    /// How they ended.
    pub(super) ended: Ended,
    pub(super) start: Instant,
    pub(super) interrupt: &'a Interrupt,
    /// Where the files went, as the user named it.
    pub(super) output: &'a Path,
}

impl Finished<'_> {
    /// Tells what was done and what was not; `result` is what ended the run.
    pub(super) fn tell(&self, result: Result<(), CliError>) -> Outcome {
        let summary = self.job.summary();
        say!(
            "{} of {} frames done in {}: {}",
            summary.done,
            summary.total,
            duration(self.start.elapsed().as_secs_f64()),
            self.output.display()
        );
        // Frames that failed earlier and were not tried again are still to be done.
        if !self.ended.failed.is_empty() {
            say!("failed: {}", list(&self.ended.failed));
        }
        events::at_end(json!({
            "done": summary.done,
            "total": summary.total,
            "failed": self.ended.failed,
        }));
        match result {
            Err(error) => {
                say!("error: {error}");
                events::at_end(json!({"errors": [error.to_string()]}));
                match error {
                    // The same command joins again.
                    CliError::Job(JobError::TakenForDead { .. }) => Outcome::Interrupted,
                    _ => Outcome::SomeFailed,
                }
            }
            Ok(()) if self.interrupt.is_raised() && self.ended.count < self.tasks => {
                Outcome::Interrupted
            }
            Ok(()) if summary.done < summary.total => Outcome::SomeFailed,
            Ok(()) => Outcome::Done,
        }
    }
}

/// Frame numbers as a range.
pub(super) fn list(frames: &[i64]) -> String {
    FrameRange::from_frames(frames.iter().copied()).map_or_else(String::new, |r| r.to_string())
}
