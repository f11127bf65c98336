//! `--follow`: frames are rendered as a running simulation writes them.

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use spherule_formats::{Sequence, SequenceError};
use spherule_jobs::Interrupt;

use super::arrivals::Arrivals;
use super::run::Run;
use crate::cli::job::Asked;
use crate::cli::signals::Listener;
use crate::cli::work::WorkArgs;
use crate::cli::{CliError, Outcome};
use crate::manifest::real_dir;

/// Shortest time between looks at the directory.
const LOOK: Duration = Duration::from_millis(200);

/// Looking takes this part of the time at most, however many files there are.
const SHARE: u32 = 10;

/// Why there will be no more frames.
enum End {
    Idle,
    StopFile,
    Interrupted,
}

/// Waits for frames.
struct Follower<'a> {
    asked: Asked,
    arrivals: Arrivals,
    stop_file: PathBuf,
    idle: Duration,
    interrupt: &'a Interrupt,
    /// When anything last happened, frames of our own included.
    busy: Instant,
    is_waiting: bool,
}

pub(super) fn run(args: &WorkArgs, asked: Asked, signals: &Listener) -> Result<Outcome, CliError> {
    if let Some(shard) = args.shard {
        return Err(CliError::other(format!(
            "--shard {shard} does not go with following: the place of a frame among all is not known before the \
             last has come; workers share the frames without it"
        )));
    }
    let work = &asked.manifest.job;
    let base = asked.absolute_base()?;
    let stop_file = match &work.stop_file {
        Some(path) => base.join(path),
        None => work.stop_file_in(&real_dir(&base.join(asked.manifest.output.path.dir()))),
    };
    let mut follower = Follower {
        arrivals: Arrivals::new(work.settle),
        stop_file,
        idle: work.idle,
        interrupt: signals.at_work_within(work.grace),
        busy: Instant::now(),
        is_waiting: false,
        asked: asked.clone(),
    };
    let (sequence, _) = match follower.next()? {
        Ok(found) => found,
        Err(End::Interrupted) => return Ok(Outcome::Interrupted),
        Err(end) => {
            return Err(CliError::other(format!(
                "no complete frame has come: {}",
                follower.told(&end)
            )));
        }
    };
    let mut run = Run::begin(args, asked, sequence)?;
    run.tell_kept();
    Ok(match follower.follow(&mut run) {
        Ok(end) => {
            say!("{}", follower.told(&end));
            let outcome = run.end(Ok(()), follower.interrupt);
            match (end, outcome) {
                (End::Interrupted, Outcome::Done) => Outcome::Interrupted,
                (_, outcome) => outcome,
            }
        }
        // Frames have been made by now, so there is a report.
        Err(error) => run.end(Err(error), follower.interrupt),
    })
}

impl Follower<'_> {
    /// Makes frames as they come, until there will be no more.
    fn follow(&mut self, run: &mut Run) -> Result<End, CliError> {
        loop {
            run.make_pending(self.interrupt)?;
            run.job.sync()?;
            self.busy = Instant::now();
            match self.next()? {
                Ok((sequence, new)) => run.extend(sequence, &new)?,
                Err(end) => return Ok(end),
            }
        }
    }

    /// Waits for complete frames: the sequence of all complete ones, and the numbers of the new ones.
    fn next(&mut self) -> Result<Result<(Sequence, Vec<i64>), End>, CliError> {
        loop {
            if self.interrupt.is_raised() {
                return Ok(Err(End::Interrupted));
            }
            let is_stopped = self.stop_file.exists();
            let start = Instant::now();
            let sequence = self.look()?;
            if let Some(mut sequence) = sequence {
                let now = Instant::now();
                self.arrivals.look(&sequence, now);
                let new = self.wanted(&sequence, now);
                if !new.is_empty() {
                    let arrivals = &self.arrivals;
                    sequence.keep_frames(|frame| arrivals.is_complete(frame.number, now));
                    self.is_waiting = false;
                    return Ok(Ok((sequence, new)));
                }
            }
            if is_stopped && self.arrivals.all_complete(Instant::now()) {
                return Ok(Err(End::StopFile));
            }
            if self.busy.max(self.arrivals.changed).elapsed() >= self.idle {
                return Ok(Err(End::Idle));
            }
            self.pause(start.elapsed());
        }
    }

    /// The sequence as it is now; None if there is nothing yet.
    fn look(&mut self) -> Result<Option<Sequence>, CliError> {
        match self.asked.sequence() {
            Ok(sequence) => Ok(Some(sequence)),
            Err(CliError::Sequence(error)) if is_nothing_yet(&error) => {
                if !std::mem::replace(&mut self.is_waiting, true) {
                    say!("waiting: {error}");
                }
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// New complete frames that were asked for.
    fn wanted(&mut self, sequence: &Sequence, now: Instant) -> Vec<i64> {
        let mut new = self.arrivals.take(now);
        if let Some(range) = &self.asked.manifest.input.frames {
            new.retain(|frame| range.contains(*frame));
        }
        // Files may go, too.
        let frames = sequence.frames();
        new.retain(|n| frames.binary_search_by_key(n, |f| f.number).is_ok());
        new
    }

    /// Waits as long as the last look justifies, or for a signal.
    fn pause(&self, looked: Duration) {
        let end = Instant::now() + LOOK.max(looked * SHARE);
        while Instant::now() < end && !self.interrupt.is_raised() {
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Why it ends, for people.
    fn told(&self, end: &End) -> String {
        match end {
            End::Idle => format!("nothing new for {} s (--idle)", self.idle.as_secs_f64()),
            End::StopFile => format!("following ends: {} is there", shown(&self.stop_file)),
            End::Interrupted => "following was interrupted; the same command goes on".to_owned(),
        }
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// What a simulation that has hardly begun looks like.
fn is_nothing_yet(error: &SequenceError) -> bool {
    matches!(
        error,
        SequenceError::Missing { .. }
            | SequenceError::NoFrames { .. }
            | SequenceError::NoMatch { .. }
    )
}
