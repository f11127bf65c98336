//! `spherule status`: prints the state of a job and its workers.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use clap::Args;
use spherule_jobs::{EntryStatus, FrameState, Job, JobState, JobSummary, WorkerStatus};

use super::job::{job_directory, no_job};
use super::print::{self, Reader};
use super::{CliError, Outcome};
use crate::report::FrameReport;
use crate::report::frame::DeviceSummary;

mod show;

#[derive(Debug, Args)]
pub(super) struct StatusArgs {
    /// A job: the directory of its images or native frames, or its manifest (job.toml).
    job: PathBuf,
    /// One JSON object.
    #[arg(long)]
    json: bool,
    /// Repeat every two seconds until all frames are done or no worker is active.
    #[arg(long)]
    watch: bool,
}

/// Time between updates.
const WATCH_INTERVAL: Duration = Duration::from_secs(2);

/// Number of recent frames from which the rate is computed.
const MAX_RATE_FRAMES: usize = 50;

/// The state of a job at one moment.
struct JobSnapshot {
    dir: PathBuf,
    state: JobState,
    summary: JobSummary,
    workers: Vec<WorkerStatus>,
}

pub(super) fn run(args: &StatusArgs) -> Result<Outcome, CliError> {
    let dir = job_directory(&args.job)?;
    let clears = args.watch && !args.json && io::stdout().is_terminal();
    loop {
        let snapshot = JobSnapshot::now(&dir)?;
        let reader = if args.json {
            print::json(&snapshot.to_json())?
        } else if clears {
            print::lines_afresh(snapshot.to_lines())?
        } else {
            print::lines(snapshot.to_lines())?
        };
        let is_over = !args.watch
            || snapshot.summary.pending == 0
            || snapshot.living_workers().next().is_none();
        if is_over || reader == Reader::Gone {
            return Ok(snapshot.outcome());
        }
        thread::sleep(WATCH_INTERVAL);
    }
}

impl JobSnapshot {
    fn now(dir: &Path) -> Result<Self, CliError> {
        // Read workers before the ledger: a frame in progress may become done in between, but not the reverse
        let workers = Job::workers(dir)?;
        let Some(state) = Job::read(dir)? else {
            return Err(no_job(dir));
        };
        Ok(Self { dir: dir.to_owned(), summary: state.summary(), state, workers })
    }

    /// Workers that have not certainly ended.
    fn living_workers(&self) -> impl Iterator<Item = &WorkerStatus> {
        self.workers.iter().filter(|worker| !worker.has_ended)
    }

    /// Frames of the plan in this state.
    fn frames(&self, state: FrameState) -> Vec<i64> {
        let numbers = self.state.plan().frames().iter().map(|f| f.number);
        numbers.filter(|frame| self.state.frame_state(*frame) == Some(state)).collect()
    }

    /// Frames that living workers are working on, ascending.
    fn running(&self) -> Vec<i64> {
        let mut frames: Vec<i64> = self.living_workers().flat_map(|w| w.frames.clone()).collect();
        frames.retain(|frame| self.state.frame_state(*frame) != Some(FrameState::Done));
        frames.sort_unstable();
        frames
    }

    /// What the frame that was finished last has of a GPU.
    fn device(&self) -> Option<DeviceSummary> {
        let entries = self.state.ledger().entries();
        let done = entries.filter(|entry| entry.status == EntryStatus::Done);
        let last = done.max_by_key(|entry| entry.time_ms)?;
        serde_json::from_value::<FrameReport>(last.details.value()).ok()?.device
    }

    /// Frames per second recently, if a worker is active and enough frames are done.
    fn rate(&self) -> Option<f64> {
        let started = self.living_workers().map(|worker| worker.since_ms).min()?;
        let entries = self.state.ledger().entries();
        let done = entries.filter(|e| e.status == EntryStatus::Done && e.time_ms >= started);
        let mut times: Vec<u64> = done.map(|entry| entry.time_ms).collect();
        // The start of the first interval
        times.push(started);
        times.sort_unstable();
        let recent = &times[times.len().saturating_sub(MAX_RATE_FRAMES + 1)..];
        let (first, last) = (recent.first()?, recent.last()?);
        let seconds = (last - first) as f64 / 1000.0;
        (seconds > 0.0).then(|| (recent.len() - 1) as f64 / seconds)
    }

    /// Remaining seconds at that rate.
    fn seconds_left(&self) -> Option<f64> {
        Some(self.summary.pending as f64 / self.rate()?)
    }

    /// The exit status: all done, some failed, or not finished.
    fn outcome(&self) -> Outcome {
        if self.summary.done == self.summary.total {
            Outcome::Done
        } else if self.summary.pending == 0 {
            Outcome::SomeFailed
        } else {
            Outcome::Interrupted
        }
    }
}
