//! The run loop: claims the frames of a job, has them processed, and records the results.
//!
//! The loop is the same for all work. It shares frames with other workers, retries crashes, stops when outputs
//! cannot be written or when it is interrupted, and reports progress as events. What is done with a frame is the
//! caller's [`FrameWork`].

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use serde_json::json;

use crate::{
    ClaimedFrame, FailureKind, FrameFailure, FrameQueue, Interrupt, Job, JobError, Panic,
    QueueEvent, catch_panic,
};

/// Work on the frames of a job.
pub trait FrameWork: Sync {
    /// The report of a finished frame, which is stored in the ledger.
    type Report: Serialize;

    /// Processes one frame. The outputs must exist when this returns.
    ///
    /// # Errors
    /// Its kind decides what the run does; see [`FailureKind`].
    fn process(
        &self,
        frame: &ClaimedFrame,
        context: &RunContext<'_, Self::Report>,
    ) -> Result<FinishedFrame<Self::Report>, FrameFailure>;

    /// Processes all frames of `queue`, and passes each result to `recorder`. By default frames are processed one
    /// after the other. Override this to overlap stages of several frames.
    ///
    /// # Errors
    /// Those of `queue` and `recorder`.
    fn process_all(
        &self,
        queue: &mut FrameQueue<'_>,
        recorder: &mut FrameRecorder<'_, Self::Report>,
    ) -> Result<(), JobError> {
        while let Some(frame) = queue.next()? {
            let mut attempt = 1;
            let result = loop {
                // Repeat an attempt that failed, as far as the settings allow
                let process = || Ok::<_, Panic>(self.process(&frame, recorder.context));
                let result = catch_panic(process).unwrap_or_else(|panic| {
                    Err(FrameFailure::new(FailureKind::Bug, frame.frame, panic))
                });
                match result {
                    Err(failure) if recorder.can_retry(&failure, attempt) => {
                        recorder.record_attempt(&failure, attempt)?;
                        attempt += 1;
                    }
                    result => break result,
                }
            };
            // Record the result; it may end the run
            if recorder.record(frame, result)? == Recorded::Stopped {
                break;
            }
        }
        Ok(())
    }
}

/// A finished frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FinishedFrame<R> {
    /// Its output files.
    pub outputs: Vec<PathBuf>,
    /// Its report.
    pub report: R,
}

/// Progress of a run. Events come from several threads.
#[derive(Debug)]
pub enum FrameEvent<'a, R> {
    /// A frame has entered a stage, or advanced in it: `reading`.
    Stage {
        /// The frame.
        frame: i64,
        /// The stage.
        stage: &'a str,
    },
    /// A frame is done: its outputs exist, and it is recorded.
    Done {
        /// The frame.
        frame: i64,
        /// Its output files and report.
        finished: &'a FinishedFrame<R>,
    },
    /// A frame failed, and the failure is recorded. The other frames continue.
    Failed(&'a FrameFailure),
    /// An attempt failed, and the failure is recorded. The frame is tried again.
    Retrying {
        /// The failure.
        failure: &'a FrameFailure,
        /// The attempt that failed, from 1.
        attempt: u32,
        /// The number of attempts.
        attempts: u32,
    },
    /// Another worker has finished a frame or holds one.
    OtherWorker(QueueEvent<'a>),
    /// A note for the user. A note that several frames share is sent once.
    Note(&'a str),
}

/// Receives events.
pub type OnFrameEvent<'a, R> = &'a (dyn Fn(FrameEvent<'_, R>) + Sync);

/// The frames of a run, and how they are processed.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The frames to process, in order: usually [`Job::pending`].
    pub frames: Vec<i64>,
    /// How often a frame is retried after a crash.
    pub retries: u32,
    /// Stops the run when it is raised.
    pub interrupt: Interrupt,
}

/// What the work on a frame may use of its run.
pub struct RunContext<'a, R> {
    on_event: OnFrameEvent<'a, R>,
    reported_notes: Mutex<HashSet<String>>,
    interrupt: Interrupt,
}

impl<R> RunContext<'_, R> {
    /// Reports that `frame` has entered a stage, or advanced in it.
    pub fn report_stage(&self, frame: i64, stage: &str) {
        (self.on_event)(FrameEvent::Stage { frame, stage });
    }

    /// Reports a note for the user, unless it was reported in this run.
    pub fn report_note(&self, note: String) {
        let mut reported = self.reported_notes.lock().unwrap_or_else(PoisonError::into_inner);
        if !reported.contains(&note) {
            (self.on_event)(FrameEvent::Note(&note));
            reported.insert(note);
        }
    }

    /// Reports several notes, each as [`RunContext::report_note`] does.
    pub fn report_notes(&self, notes: impl IntoIterator<Item = String>) {
        notes.into_iter().for_each(|note| self.report_note(note));
    }

    /// The interrupt of the run.
    pub const fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }
}

/// Whether a run continues after a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recorded {
    /// It continues.
    Continue,
    /// It stops: the frame was interrupted.
    Stopped,
}

/// Records the results of a run in its job.
pub struct FrameRecorder<'a, R> {
    job: &'a mut Job,
    context: &'a RunContext<'a, R>,
    attempts: u32,
}

impl<'a, R: Serialize> FrameRecorder<'a, R> {
    /// The context of the run.
    pub const fn context(&self) -> &'a RunContext<'a, R> {
        self.context
    }

    /// The error of a worker that others consider dead, because a frame is no longer [held](ClaimedFrame::is_held).
    pub fn declared_dead(&self) -> JobError {
        JobError::DeclaredDead { dir: self.job.state().dir().to_owned() }
    }

    /// Records the result of a frame, and drops its claim.
    ///
    /// # Errors
    /// [`JobError::Stopped`] if outputs cannot be written, or the ledger cannot be written.
    pub fn record(
        &mut self,
        frame: ClaimedFrame,
        result: Result<FinishedFrame<R>, FrameFailure>,
    ) -> Result<Recorded, JobError> {
        let number = frame.frame;
        match result {
            Ok(finished) => {
                let details = json!(finished.report);
                let recorded = self.job.record_done(number, &finished.outputs, details);
                recorded.map_err(|e| self.job.claims.explain(e))?;
                let finished = &finished;
                (self.context.on_event)(FrameEvent::Done { frame: number, finished });
            }
            Err(failure) if failure.kind == FailureKind::Interrupted => {
                return Ok(Recorded::Stopped);
            }
            Err(failure) if failure.kind.stops_run() => {
                return Err(self.job.claims.explain(JobError::Stopped(failure)));
            }
            Err(failure) => {
                (self.context.on_event)(FrameEvent::Failed(&failure));
                self.job.record_failed(&failure)?;
            }
        }
        frame.claim.complete();
        Ok(Recorded::Continue)
    }

    fn can_retry(&self, failure: &FrameFailure, attempt: u32) -> bool {
        failure.kind.is_retryable() && attempt < self.attempts
    }

    fn record_attempt(&mut self, failure: &FrameFailure, attempt: u32) -> Result<(), JobError> {
        (self.context.on_event)(FrameEvent::Retrying { failure, attempt, attempts: self.attempts });
        self.job.record_failed(failure)
    }
}

/// Processes those of the frames in `options` that no other worker holds, in order, and records each in `job`.
/// Returns when all are finished, by any worker. Once the interrupt is raised, returns after the frames in progress,
/// or drops them if the interrupt says to stop now.
///
/// # Errors
/// The ledger or the outputs cannot be written, for example because the disk is full.
pub fn run_frames<W: FrameWork>(
    job: &mut Job,
    work: &W,
    options: &RunOptions,
    on_event: OnFrameEvent<'_, W::Report>,
) -> Result<(), JobError> {
    let context = RunContext {
        on_event,
        reported_notes: Mutex::default(),
        interrupt: options.interrupt.clone(),
    };
    let on_queue_event = |event: QueueEvent| on_event(FrameEvent::OtherWorker(event));
    let frames = options.frames.iter().copied();
    let mut queue = FrameQueue::new(job.claims(), frames, &options.interrupt, &on_queue_event);
    let mut recorder =
        FrameRecorder { job, context: &context, attempts: options.retries.saturating_add(1) };
    work.process_all(&mut queue, &mut recorder)
}
