//! Follows a simulation: waits for the frames that it writes.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};
use std::{fmt, fs, thread};

use spherule_formats::{FrameError, Sequence, SequenceError};
use spherule_jobs::Interrupt;

use super::complete_frames::CompleteFrames;
use super::{JobManifest, RunError};

/// Shortest time between scans of the directory.
const MIN_SCAN_INTERVAL: Duration = Duration::from_millis(200);

/// Scans use at most one part in this many of the time, however many files there are.
const SCAN_SHARE: u32 = 10;

/// Why following ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FollowEnd {
    /// No new frames came for this long.
    Idle(Duration),
    /// The stop file exists.
    StopFile(PathBuf),
    /// The run was interrupted.
    Interrupted,
}

impl fmt::Display for FollowEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Idle(time) => write!(f, "no new frames for {} s", time.as_secs_f64()),
            Self::StopFile(path) => write!(f, "{} exists", path.display()),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// Waits for complete frames of an input that still grows.
pub struct Follower<'a> {
    manifest: JobManifest,
    complete: CompleteFrames,
    stop_file: StopFile,
    interrupt: Interrupt,
    on_waiting: &'a dyn Fn(&SequenceError),
    /// When frames were last rendered.
    last_activity: Instant,
    is_waiting: bool,
}

/// The file that ends following when it appears.
struct StopFile {
    path: PathBuf,
    /// When the file was written that an earlier run has left.
    earlier: Option<SystemTime>,
}

impl StopFile {
    fn new(path: PathBuf) -> Self {
        let earlier = modified(&path);
        Self { path, earlier }
    }

    /// Whether the file was written since following began.
    fn has_appeared(&self) -> bool {
        let now = modified(&self.path);
        now.is_some() && now != self.earlier
    }
}

fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|file| file.modified()).ok()
}

impl<'a> Follower<'a> {
    /// Follows the input of `manifest`, with the times in its section `job`. `on_waiting` is called once if the input
    /// does not exist yet.
    ///
    /// # Errors
    /// The current directory is unknown.
    pub fn new(
        manifest: JobManifest,
        interrupt: &Interrupt,
        on_waiting: &'a dyn Fn(&SequenceError),
    ) -> Result<Self, RunError> {
        Ok(Self {
            complete: CompleteFrames::new(manifest.manifest.job.settle),
            stop_file: StopFile::new(manifest.stop_file()?),
            manifest,
            interrupt: interrupt.clone(),
            on_waiting,
            last_activity: Instant::now(),
            is_waiting: false,
        })
    }

    /// The stop file of an earlier run, which does not end this one.
    pub fn earlier_stop_file(&self) -> Option<&Path> {
        let stop_file = &self.stop_file;
        stop_file.earlier.map(|_| &*stop_file.path)
    }

    /// The interrupt that ends following.
    pub const fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// Follows only these parts from now on; None stands for all.
    pub fn keep_parts(&mut self, parts: Option<Vec<String>>) {
        self.manifest.manifest.input.parts = parts;
    }

    /// Resets the time without new frames.
    pub fn mark_activity(&mut self) {
        self.last_activity = Instant::now();
    }

    /// Waits for complete frames. Returns the sequence of all complete frames and the numbers of the new ones, or why
    /// there will be no more.
    ///
    /// # Errors
    /// The input cannot be listed.
    #[expect(clippy::should_implement_trait, reason = "an iterator cannot return errors with `?`")]
    pub fn next(&mut self) -> Result<Result<(Sequence, Vec<i64>), FollowEnd>, RunError> {
        loop {
            if self.interrupt.is_raised() {
                return Ok(Err(FollowEnd::Interrupted));
            }
            // Check before the scan: frames that were complete when the file appeared are still rendered
            let is_stopped = self.stop_file.has_appeared();
            let start = Instant::now();
            // Look for frames that are complete by now
            if let Some(mut sequence) = self.scan()? {
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
            // Decide whether there will be more
            if is_stopped && self.complete.all_complete(Instant::now()) {
                return Ok(Err(FollowEnd::StopFile(self.stop_file.path.clone())));
            }
            let idle = self.manifest.manifest.job.idle;
            if self.last_activity.max(self.complete.last_change).elapsed() >= idle {
                return Ok(Err(FollowEnd::Idle(idle)));
            }
            self.pause(start.elapsed());
        }
    }

    /// The current sequence; None if no file exists yet.
    fn scan(&mut self) -> Result<Option<Sequence>, RunError> {
        match self.manifest.open_sequence() {
            Ok(sequence) => Ok(Some(sequence)),
            Err(RunError::Sequence(error)) if is_not_written_yet(&error) => {
                if !std::mem::replace(&mut self.is_waiting, true) {
                    (self.on_waiting)(&error);
                }
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// The new complete frames among those that are selected.
    fn new_frames(&mut self, sequence: &Sequence, now: Instant) -> Vec<i64> {
        let mut new = self.complete.take_new(now);
        if let Some(range) = &self.manifest.manifest.input.frames {
            new.retain(|frame| range.contains(*frame));
        }
        // Files may also have been removed
        let frames = sequence.frames();
        new.retain(|n| frames.binary_search_by_key(n, |f| f.number).is_ok());
        new
    }

    /// Waits in proportion to the time of the last scan, or until the interrupt is raised.
    fn pause(&self, scan_time: Duration) {
        let end = Instant::now() + MIN_SCAN_INTERVAL.max(scan_time * SCAN_SHARE);
        while Instant::now() < end && !self.interrupt.is_raised() {
            thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Whether the error is expected before a simulation has written its first frame, or while it writes a list of files.
fn is_not_written_yet(error: &SequenceError) -> bool {
    matches!(
        error,
        SequenceError::List(FrameError::Malformed { .. })
            | SequenceError::Missing { .. }
            | SequenceError::NoFrames { .. }
            | SequenceError::NoMatch { .. }
    )
}
