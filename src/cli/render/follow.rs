//! `--follow`: renders frames while a simulation writes them.

use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use spherule_formats::{Sequence, SequenceError};
use spherule_jobs::Interrupt;

use super::complete_frames::CompleteFrames;
use super::run::Run;
use crate::cli::job::JobArgs;
use crate::cli::manifest_args::RequestedManifest;
use crate::cli::signals::SignalListener;
use crate::cli::{CliError, Outcome};
use crate::manifest::real_dir;

/// Shortest time between scans of the directory.
const MIN_SCAN_INTERVAL: Duration = Duration::from_millis(200);

/// Scans use at most one part in this many of the time, however many files there are.
const SCAN_SHARE: u32 = 10;

/// Why following ends.
enum FollowEnd {
    Idle,
    StopFile,
    Interrupted,
}

/// Waits for frames.
struct Follower<'a> {
    requested: RequestedManifest,
    complete: CompleteFrames,
    stop_file: PathBuf,
    idle: Duration,
    interrupt: &'a Interrupt,
    /// When the last frame was rendered.
    last_render: Instant,
    is_waiting: bool,
}

pub(super) fn run(
    args: &JobArgs,
    requested: RequestedManifest,
    signals: &SignalListener,
) -> Result<Outcome, CliError> {
    if let Some(shard) = args.shard {
        return Err(CliError::other(format!(
            "--shard {shard} does not combine with --follow: the shard of a frame is unknown until the last frame \
             exists; several workers share the frames without it"
        )));
    }
    let settings = &requested.manifest.job;
    let base = requested.absolute_base()?;
    let stop_file = match &settings.stop_file {
        Some(path) => base.join(path),
        None => settings.stop_file_in(&real_dir(&base.join(requested.manifest.output.path.dir()))),
    };
    let mut follower = Follower {
        complete: CompleteFrames::new(settings.settle),
        stop_file,
        idle: settings.idle,
        interrupt: signals.start_work_with_grace(settings.grace),
        last_render: Instant::now(),
        is_waiting: false,
        requested: requested.clone(),
    };
    let (sequence, _) = match follower.next()? {
        Ok(found) => found,
        Err(FollowEnd::Interrupted) => return Ok(Outcome::Interrupted),
        Err(end) => {
            return Err(CliError::other(format!(
                "found no complete frame: {}",
                follower.description(&end)
            )));
        }
    };
    let mut run = Run::start(args, requested, sequence)?;
    run.report_kept();
    Ok(match follower.follow(&mut run) {
        Ok(end) => {
            message!("{}", follower.description(&end));
            let outcome = run.end(Ok(()), follower.interrupt);
            match (end, outcome) {
                (FollowEnd::Interrupted, Outcome::Done) => Outcome::Interrupted,
                (_, outcome) => outcome,
            }
        }
        // Frames were rendered, so write the reports
        Err(error) => run.end(Err(error), follower.interrupt),
    })
}

impl Follower<'_> {
    /// Renders frames as they arrive, until following ends.
    fn follow(&mut self, run: &mut Run) -> Result<FollowEnd, CliError> {
        loop {
            run.render_pending(self.interrupt)?;
            run.job.sync()?;
            self.last_render = Instant::now();
            match self.next()? {
                Ok((sequence, new)) => run.extend(sequence, &new)?,
                Err(end) => return Ok(end),
            }
        }
    }

    /// Waits for complete frames. Returns the sequence of all complete frames and the numbers of the new ones.
    fn next(&mut self) -> Result<Result<(Sequence, Vec<i64>), FollowEnd>, CliError> {
        loop {
            if self.interrupt.is_raised() {
                return Ok(Err(FollowEnd::Interrupted));
            }
            let is_stopped = self.stop_file.exists();
            let start = Instant::now();
            let sequence = self.scan()?;
            if let Some(mut sequence) = sequence {
                let now = Instant::now();
                self.complete.update(&sequence, now);
                let new = self.new_frames(&sequence, now);
                if !new.is_empty() {
                    let complete = &self.complete;
                    sequence.keep_frames(|frame| complete.is_complete(frame.number, now));
                    self.is_waiting = false;
                    return Ok(Ok((sequence, new)));
                }
            }
            if is_stopped && self.complete.all_complete(Instant::now()) {
                return Ok(Err(FollowEnd::StopFile));
            }
            if self.last_render.max(self.complete.last_change).elapsed() >= self.idle {
                return Ok(Err(FollowEnd::Idle));
            }
            self.pause(start.elapsed());
        }
    }

    /// The current sequence; None if no file exists yet.
    fn scan(&mut self) -> Result<Option<Sequence>, CliError> {
        match self.requested.sequence() {
            Ok(sequence) => Ok(Some(sequence)),
            Err(CliError::Sequence(error)) if is_not_written_yet(&error) => {
                if !std::mem::replace(&mut self.is_waiting, true) {
                    message!("waiting: {error}");
                }
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// The new complete frames among those that are selected.
    fn new_frames(&mut self, sequence: &Sequence, now: Instant) -> Vec<i64> {
        let mut new = self.complete.take_new(now);
        if let Some(range) = &self.requested.manifest.input.frames {
            new.retain(|frame| range.contains(*frame));
        }
        // Files may also have been removed
        let frames = sequence.frames();
        new.retain(|n| frames.binary_search_by_key(n, |f| f.number).is_ok());
        new
    }

    /// Waits in proportion to the time of the last scan, or until a signal.
    fn pause(&self, scan_time: Duration) {
        let end = Instant::now() + MIN_SCAN_INTERVAL.max(scan_time * SCAN_SHARE);
        while Instant::now() < end && !self.interrupt.is_raised() {
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Why following ends, as a message.
    fn description(&self, end: &FollowEnd) -> String {
        match end {
            FollowEnd::Idle => format!("no new frames for {} s (--idle)", self.idle.as_secs_f64()),
            FollowEnd::StopFile => format!("following ends: {} exists", self.stop_file.display()),
            FollowEnd::Interrupted => {
                "following was interrupted; the same command continues".to_owned()
            }
        }
    }
}

/// Whether the error is expected before a simulation has written its first frame.
fn is_not_written_yet(error: &SequenceError) -> bool {
    matches!(
        error,
        SequenceError::Missing { .. }
            | SequenceError::NoFrames { .. }
            | SequenceError::NoMatch { .. }
    )
}
