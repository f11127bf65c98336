//! `spherule status`: how a job stands, and who is at it.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use clap::Args;
use spherule_jobs::{FrameState, Job, JobState, Status, Summary, WorkerView};

use super::print::{self, Reader};
use super::work::{job_directory, no_job};
use super::{CliError, Outcome};

mod show;

#[derive(Debug, Args)]
pub(super) struct StatusArgs {
    /// A job: the directory of its images or native frames, or its manifest (job.toml).
    job: PathBuf,
    /// One JSON object.
    #[arg(long)]
    json: bool,
    /// Tell again every two seconds, until all frames are done or nobody is at work.
    #[arg(long)]
    watch: bool,
}

/// Between two looks.
const PAUSE: Duration = Duration::from_secs(2);

/// Frames whose ends the rate is taken from.
const RECENT: usize = 50;

/// A job at one moment.
struct Standing {
    dir: PathBuf,
    state: JobState,
    summary: Summary,
    workers: Vec<WorkerView>,
}

pub(super) fn run(args: &StatusArgs) -> Result<Outcome, CliError> {
    let dir = job_directory(&args.job)?;
    let clears = args.watch && !args.json && io::stdout().is_terminal();
    loop {
        let standing = Standing::now(&dir)?;
        let reader = if args.json {
            print::json(&standing.to_json())?
        } else if clears {
            print::lines_afresh(standing.to_lines())?
        } else {
            print::lines(standing.to_lines())?
        };
        let is_over =
            !args.watch || standing.summary.pending == 0 || standing.living().next().is_none();
        if is_over || reader == Reader::Gone {
            return Ok(standing.outcome());
        }
        thread::sleep(PAUSE);
    }
}

impl Standing {
    fn now(dir: &Path) -> Result<Self, CliError> {
        // First: what a worker has in hand now may be done in a moment, but not the other way around.
        let workers = Job::workers(dir)?;
        let Some(state) = Job::read(dir)? else {
            return Err(no_job(dir));
        };
        Ok(Self {
            dir: dir.to_owned(),
            summary: state.summary(),
            state,
            workers,
        })
    }

    /// Workers that have not certainly ended.
    fn living(&self) -> impl Iterator<Item = &WorkerView> {
        self.workers.iter().filter(|worker| !worker.has_ended)
    }

    /// Frames of the plan that stand so.
    fn frames(&self, state: FrameState) -> Vec<i64> {
        let numbers = self.state.plan().frames().iter().map(|f| f.number);
        numbers
            .filter(|frame| self.state.frame_state(*frame) == Some(state))
            .collect()
    }

    /// Frames in the hands of living workers, ascending.
    fn running(&self) -> Vec<i64> {
        let mut frames: Vec<i64> = self.living().flat_map(|w| w.frames.clone()).collect();
        frames.retain(|frame| self.state.frame_state(*frame) != Some(FrameState::Done));
        frames.sort_unstable();
        frames
    }

    /// Frames a second of late, if somebody is at work and enough is known.
    fn rate(&self) -> Option<f64> {
        let begun = self.living().map(|worker| worker.since_ms).min()?;
        let entries = self.state.ledger().entries();
        let done = entries.filter(|e| e.status == Status::Done && e.time_ms >= begun);
        let mut times: Vec<u64> = done.map(|entry| entry.time_ms).collect();
        // Counts the frames that ended after it.
        times.push(begun);
        times.sort_unstable();
        let recent = &times[times.len().saturating_sub(RECENT + 1)..];
        let (first, last) = (recent.first()?, recent.last()?);
        let seconds = (last - first) as f64 / 1000.0;
        (seconds > 0.0).then(|| (recent.len() - 1) as f64 / seconds)
    }

    /// Seconds left at that rate.
    fn seconds_left(&self) -> Option<f64> {
        Some(self.summary.pending as f64 / self.rate()?)
    }

    /// For scripts: whether it is done, has failures, or is to be gone on with.
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
