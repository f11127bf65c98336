//! Converts the frames of a sequence to native frames, one after the other. Each is recorded in the job once its file
//! exists.
//!
//! [`Conversion`] has the settings that all frames share. The caller shows progress ([`Event`]).

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::path::PathBuf;

use serde_json::json;
use spherule_formats::Sequence;
use spherule_formats::convert::{Phase, Progress};
use spherule_formats::write::own_temporaries;
use spherule_jobs::{FrameFailure, FrameQueue, Interrupt, Job, JobError, QueueEvent};

mod attributes;
mod error;
mod frame;
mod settings;

pub use attributes::{AttributeChoices, Storage};
pub use error::{ConversionError, UnknownAttribute};
pub use frame::{ConvertedFrame, convert_frame};
pub use settings::{Conversion, ConvertSettings};

use crate::failure::catch_panic;

/// One frame to convert.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConvertTask {
    /// Frame number.
    pub frame: i64,
    /// Index in the sequence.
    pub index: usize,
    /// Path of the native frame.
    pub output: PathBuf,
}

/// Progress of a conversion.
#[derive(Debug)]
pub enum Event<'a> {
    /// Conversion of a frame has started.
    Started(i64),
    /// A phase of the frame has processed this many particles of this many.
    Advanced(i64, Phase, u64, u64),
    /// A frame's file exists and is recorded.
    Done(&'a ConvertTask, &'a ConvertedFrame),
    /// A frame failed, and the failure was recorded. The other frames continue.
    Failed(&'a FrameFailure),
    /// Another worker has finished a frame or holds one.
    OtherWorker(QueueEvent<'a>),
    /// A note for the user.
    Note(&'a str),
}

/// Receives events, from several threads.
pub type OnEvent<'a> = &'a (dyn Fn(Event) + Sync);

/// Forwards the progress of one frame as events.
struct FrameProgress<'a> {
    frame: i64,
    on_event: OnEvent<'a>,
}

impl Progress for FrameProgress<'_> {
    fn advanced(&self, phase: Phase, done: u64, total: u64) -> ControlFlow<()> {
        (self.on_event)(Event::Advanced(self.frame, phase, done, total));
        ControlFlow::Continue(())
    }
}

/// Converts those of `tasks` that no other worker holds, in order, and records each in `job`. Returns when all are
/// finished, by any worker. Once `interrupt` is raised, returns after the frame in progress.
///
/// # Errors
/// The ledger or the output cannot be written, for example because the disk is full.
pub fn run(
    conversion: &Conversion,
    sequence: &Sequence,
    tasks: &[ConvertTask],
    job: &mut Job,
    interrupt: &Interrupt,
    on_event: OnEvent,
) -> Result<(), JobError> {
    let mut reported_notes = HashSet::new();
    // The job can then find the temporary files of a killed run
    own_temporaries(spherule_jobs::owner());
    let frames = tasks.iter().map(|task| task.frame);
    let mut queue = FrameQueue::new(job.claims(), frames, interrupt);
    let mut on_queue_event = |event: QueueEvent| on_event(Event::OtherWorker(event));
    while let Some((index, claim)) = queue.next(&mut on_queue_event)? {
        let task = &tasks[index];
        on_event(Event::Started(task.frame));
        let progress = FrameProgress {
            frame: task.frame,
            on_event,
        };
        let result = catch_panic(|| {
            convert_frame(conversion, sequence, task, &progress)
                .map_err(|e| ConversionError::new(e, sequence, task.index))
        });
        match result {
            Ok(converted) => {
                // Report a note that all frames share once
                for note in &converted.notes {
                    if reported_notes.insert(note.clone()) {
                        on_event(Event::Note(note));
                    }
                }
                let outputs = std::slice::from_ref(&task.output);
                job.record_done(task.frame, outputs, json!(converted))?;
                on_event(Event::Done(task, &converted));
            }
            Err(error) => {
                let failure = error.into_failure(task);
                if failure.kind.stops_run() {
                    return Err(JobError::Stopped(failure));
                }
                on_event(Event::Failed(&failure));
                job.record_failed(&failure)?;
            }
        }
        claim.complete();
    }
    Ok(())
}
