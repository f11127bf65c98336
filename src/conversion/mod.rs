//! A sequence becomes native frames, one after the other, each recorded in the job once its file is in
//! place.
//!
//! What holds for all frames is settled before, in [`Conversion`]; what the user is shown, the caller
//! decides ([`Event`]).

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::path::PathBuf;

use serde_json::json;
use spherule_formats::convert::{ConvertError, Phase, Progress};
use spherule_formats::write::own_temporaries;
use spherule_formats::{FrameError, Sequence};
use spherule_jobs::{Interrupt, Job, JobError, Queue, QueueNews};

mod attributes;
mod frame;
mod settings;

pub use attributes::{AttributeChoices, Storage};
pub use frame::{ConvertedFrame, convert_frame};
pub use settings::{Conversion, ConvertSettings};

use crate::mishap::{guarded, is_place_at_fault, may_be_unfinished};

/// One native frame to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConvertTask {
    /// Frame number.
    pub frame: i64,
    /// Index in the sequence.
    pub index: usize,
    /// The native frame.
    pub output: PathBuf,
}

/// What whoever watches is told.
#[derive(Debug)]
pub enum Event<'a> {
    /// A frame is in hand.
    Entered(i64),
    /// So many particles of so many have passed a phase of the frame in hand.
    Advanced(i64, Phase, u64, u64),
    /// A frame's file is in place and recorded.
    Done(&'a ConvertTask, &'a ConvertedFrame),
    /// A frame could not be converted; it is recorded with this reason and the rest goes on.
    Failed(i64, &'a str),
    /// Other workers are at frames of the run.
    Others(QueueNews<'a>),
    /// Something the user should know.
    Note(&'a str),
}

/// Who watches; told from many threads.
pub type Watch<'a> = &'a (dyn Fn(Event) + Sync);

/// A frame in hand that is watched.
struct Watched<'a> {
    frame: i64,
    watch: Watch<'a>,
}

impl Progress for Watched<'_> {
    fn advanced(&self, phase: Phase, done: u64, total: u64) -> ControlFlow<()> {
        (self.watch)(Event::Advanced(self.frame, phase, done, total));
        ControlFlow::Continue(())
    }
}

/// Converts those of `tasks` that no other worker does, in order, and records each in `job`; returns when all
/// are ended, by whomever. Ends early, with the frame in hand finished, once
/// `interrupt` is raised.
///
/// # Errors
/// The ledger cannot be written, or the disk is full: nothing further could be recorded.
pub fn run(
    conversion: &Conversion,
    sequence: &Sequence,
    tasks: &[ConvertTask],
    job: &mut Job,
    interrupt: &Interrupt,
    watch: Watch,
) -> Result<(), JobError> {
    let mut told = HashSet::new();
    // So that the job knows what a killed run has left.
    own_temporaries(spherule_jobs::owner());
    let frames = tasks.iter().map(|task| task.frame);
    let mut queue = Queue::new(job.claims(), frames, interrupt);
    let mut heard = |news: QueueNews| watch(Event::Others(news));
    while let Some((place, claim)) = queue.take(&mut heard)? {
        let task = &tasks[place];
        watch(Event::Entered(task.frame));
        let watched = Watched {
            frame: task.frame,
            watch,
        };
        match guarded(|| Ok(convert_frame(conversion, sequence, task, &watched))) {
            Ok(Ok(converted)) => {
                // What is so in every frame is said once.
                for note in &converted.notes {
                    if told.insert(note.clone()) {
                        watch(Event::Note(note));
                    }
                }
                let outputs = std::slice::from_ref(&task.output);
                job.record_done(task.frame, outputs, json!(converted))?;
                watch(Event::Done(task, &converted));
            }
            // Not the frame's fault: it stays to be done.
            Ok(Err(ConvertError::Frame(FrameError::Io { path, source })))
                if path.starts_with(task.output.parent().unwrap_or(&task.output))
                    && is_place_at_fault(&source) =>
            {
                return Err(JobError::writing(&path, source));
            }
            Ok(Err(error)) => fail(job, watch, task, &reason(sequence, task, &error))?,
            Err(fault) => fail(job, watch, task, &fault)?,
        }
        claim.end();
    }
    Ok(())
}

fn fail(job: &mut Job, watch: Watch, task: &ConvertTask, reason: &str) -> Result<(), JobError> {
    watch(Event::Failed(task.frame, reason));
    job.record_failed(task.frame, reason, json!(null))
}

/// Why a frame cannot be converted, with what may help.
fn reason(sequence: &Sequence, task: &ConvertTask, error: &ConvertError) -> String {
    if let ConvertError::Frame(error) = error
        && may_be_unfinished(sequence, task.index, error)
    {
        return format!(
            "{error}; it is the newest frame, perhaps still being written: convert again later"
        );
    }
    error.to_string()
}
