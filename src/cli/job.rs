//! Shared by the commands that run jobs: how earlier runs are resumed, where files go, and the report at the end.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::json;
use spherule_jobs::{FrameRange, Interrupt, Job, JobError, JobState, PLAN_FILE, ResumeMode};

use super::manifest_args::{is_manifest, read_manifest};
use super::paths::absolute;
use super::progress::{FinishedFrames, duration};
use super::{CliError, Outcome, events};
use crate::job::{RunError, Shard, requested_frames};
use crate::manifest::{Manifest, real_dir};

/// How one run treats the results of earlier runs. These options are not in the manifest: a manifest that always
/// starts over would discard finished work.
#[derive(Debug, Args)]
#[command(next_help_heading = "Job")]
pub(super) struct JobArgs {
    /// Start over and discard the results of earlier runs.
    #[arg(long)]
    pub(super) force: bool,
    /// Keep finished frames although settings or inputs have changed.
    #[arg(long, conflicts_with = "force")]
    pub(super) keep_done: bool,
    /// Process only one part of the frames: 2/4 is the second of four.
    ///
    /// Several workers on the same job share its frames without this option too.
    #[arg(long, value_name = "I/N", allow_hyphen_values = true)]
    pub(super) shard: Option<Shard>,
}

impl JobArgs {
    /// The mode that the options select.
    pub(super) const fn mode(&self) -> ResumeMode {
        match (self.force, self.keep_done) {
            (true, _) => ResumeMode::Force,
            (_, true) => ResumeMode::KeepDone,
            _ => ResumeMode::Resume,
        }
    }
}

/// Useful threads per processor. Far more threads block each other: 2000 on two processors need minutes for the
/// work that two do in milliseconds.
const MAX_THREADS_PER_PROCESSOR: usize = 4;

/// Sets the number of threads; None uses the default of the machine.
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

/// `requested` threads, limited to the number that is useful on this machine.
pub(super) fn useful_threads(requested: usize) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let max = processors.saturating_mul(MAX_THREADS_PER_PROCESSOR);
    if requested > max {
        note!(
            "--threads {requested}: {max} are used, {MAX_THREADS_PER_PROCESSOR} for each of {processors} processors"
        );
    }
    requested.min(max)
}

/// The directory of a job that is given as a directory or as a manifest.
pub(super) fn job_directory(job: &Path) -> Result<PathBuf, CliError> {
    if job.is_file() && !is_manifest(job) {
        let dir = job.parent().filter(|dir| !dir.as_os_str().is_empty());
        return Err(CliError::other(format!(
            "{}: is a file; give the directory of the job: {}",
            job.display(),
            dir.unwrap_or(Path::new(".")).display()
        )));
    }
    if !is_manifest(job) || job.is_dir() {
        return Ok(job.to_owned());
    }
    let text = read_manifest(job)?;
    let manifest = Manifest::parse(&text, job)?;
    let base = absolute(job.parent().unwrap_or(Path::new("")))?;
    Ok(real_dir(&base.join(manifest.output.path.dir())))
}

/// The error for a directory without a job.
pub(super) fn no_job(dir: &Path) -> CliError {
    CliError::other(format!(
        "{}: no job here (no {PLAN_FILE}); give the directory of its images, or its job.toml",
        dir.display()
    ))
}

/// The frames of the job in `range`; without a range those that its runs have asked for.
pub(super) fn selected_frames(
    state: &JobState,
    range: Option<&FrameRange>,
) -> Result<Vec<i64>, CliError> {
    let numbers: Vec<i64> = state.plan().frames().iter().map(|f| f.number).collect();
    // Without a range, take what renders have asked for
    let Some(range) = range else {
        let requested = requested_frames(state);
        if requested.len() < numbers.len() {
            note!(
                "{} of {} frames, those that renders have asked for; --frames {} takes all",
                requested.len(),
                numbers.len(),
                list(&numbers)
            );
        }
        return Ok(requested);
    };
    // A range without frames of the job is probably a mistake
    let selected = range.select(&numbers);
    if selected.is_empty() {
        return Err(CliError::other(format!(
            "--frames: {range} contains none of the job's frames: {}",
            list(&numbers)
        )));
    }
    Ok(selected)
}

/// Reports that opening the job in `dir` waits for other workers, which may have died with their machine: a job is not
/// replaced while others work on it.
pub(super) fn report_wait(dir: &Path, takeover_after: Duration) -> Result<(), CliError> {
    if let Some(worker) = Job::workers(dir)?.iter().find(|worker| !worker.has_ended) {
        message!(
            "waiting for a heartbeat of process {} on {}, {} at most",
            worker.pid,
            worker.host,
            duration(takeover_after.as_secs_f64())
        );
    }
    Ok(())
}

/// Reports how many frames of the run are done already.
pub(super) fn report_kept(job: &Job, tasks: usize) {
    let selected = job.selected().len();
    if selected > tasks {
        message!("{} of {selected} frames are done already", selected - tasks);
    }
}

/// The end of a run.
pub(super) struct FinishedRun<'a> {
    pub(super) job: &'a Job,
    /// Number of frames that were pending.
    pub(super) task_count: usize,
    /// The finished frames.
    pub(super) frames: FinishedFrames,
    pub(super) start: Instant,
    pub(super) interrupt: &'a Interrupt,
    /// The output path that the user gave.
    pub(super) output: &'a Path,
}

impl FinishedRun<'_> {
    /// Reports finished and failed frames, and the error if `result` is one. Returns the exit status.
    pub(super) fn report(&self, result: Result<(), RunError>) -> Outcome {
        let summary = self.job.summary();
        message!(
            "{} of {} frames done in {}: {}",
            summary.done,
            summary.total,
            duration(self.start.elapsed().as_secs_f64()),
            self.output.display()
        );
        // Only frames of this run: others may have failed earlier without being retried
        if !self.frames.failed.is_empty() {
            message!("failed: {}", list(&self.frames.failed));
        }
        events::add_to_end(json!({
            "done": summary.done,
            "total": summary.total,
            "failed": self.frames.failed,
        }));
        match result {
            Err(error) => {
                // The same command rejoins the job
                let is_temporary = matches!(error, RunError::Job(JobError::DeclaredDead { .. }));
                let error = CliError::from(error).to_string();
                error!("{error}");
                events::add_to_end(json!({"errors": [error]}));
                if is_temporary { Outcome::Interrupted } else { Outcome::SomeFailed }
            }
            Ok(()) if self.interrupt.is_raised() && self.frames.count < self.task_count => {
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
