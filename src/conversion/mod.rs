//! Converts a sequence to native frames, one after another. Each is recorded in the job after its file is complete.
//!
//! Settings that are common to all frames are in [`Conversion`]. The caller decides which [`Event`]s are shown to the
//! user.

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

/// One native frame to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConvertTask {
    /// Frame number.
    pub frame: i64,
    /// Index in the sequence.
    pub index: usize,
    /// Path of the native frame.
    pub output: PathBuf,
}

/// Events of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// The conversion of a frame has started.
    Entered(i64),
    /// Progress of a phase of the current frame: particles done, and their total number.
    Advanced(i64, Phase, u64, u64),
    /// The file of a frame is complete and recorded.
    Done(&'a ConvertTask, &'a ConvertedFrame),
    /// A frame could not be converted. It is recorded with this reason, and the run continues.
    Failed(i64, &'a str),
    /// Other workers are working on frames of the run.
    Others(QueueNews<'a>),
    /// A note for the user.
    Note(&'a str),
}

/// An event handler, called from many threads.
pub type Watch<'a> = &'a (dyn Fn(Event) + Sync);

/// Reports the progress of the current frame.
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

/// Converts those of `tasks` that no other worker has claimed, in order, and records each in `job`. Returns when all
/// of them are finished, by any worker. If `interrupt` is raised, finishes only the current frame.
///
/// # Errors
/// The ledger cannot be written, or the disk is full: further frames could not be recorded.
pub fn run(
    conversion: &Conversion,
    sequence: &Sequence,
    tasks: &[ConvertTask],
    job: &mut Job,
    interrupt: &Interrupt,
    watch: Watch,
) -> Result<(), JobError> {
    let mut told = HashSet::new();
    // Mark temporary files with the owner, so that the job recognises those of a killed run.
    own_temporaries(spherule_jobs::owner());
    let frames = tasks.iter().map(|task| task.frame);
    let mut queue = Queue::new(job.claims(), frames, interrupt);
    let mut heard = |news: QueueNews| watch(Event::Others(news));
    while let Some((place, claim)) = queue.take(&mut heard)? {
        // Convert the frame
        let task = &tasks[place];
        watch(Event::Entered(task.frame));
        let watched = Watched {
            frame: task.frame,
            watch,
        };
        match guarded(|| Ok(convert_frame(conversion, sequence, task, &watched))) {
            Ok(Ok(converted)) => {
                // A note that applies to every frame is reported once.
                for note in &converted.notes {
                    if told.insert(note.clone()) {
                        watch(Event::Note(note));
                    }
                }
                let outputs = std::slice::from_ref(&task.output);
                job.record_done(task.frame, outputs, json!(converted))?;
                watch(Event::Done(task, &converted));
            }
            // The disk is at fault, not the frame, which remains to be done.
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

/// The reason why a frame cannot be converted, with a remedy.
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
