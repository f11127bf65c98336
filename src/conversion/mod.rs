//! Converts the frames of a sequence to native frames, one after the other. Each is recorded in the job once its file
//! exists. [`Conversion`] has the settings that all frames share.

use std::ops::ControlFlow;
use std::path::PathBuf;

use spherule_formats::Sequence;
use spherule_formats::convert::{Phase, Progress};
use spherule_jobs::{ClaimedFrame, FinishedFrame, FrameFailure, FrameWork, RunContext};

mod attributes;
mod error;
mod frame;
mod settings;

pub use attributes::{AttributeChoices, Storage};
pub use error::{ConversionError, UnknownAttribute};
pub use frame::{ConvertedFrame, convert_frame};
pub use settings::{Conversion, ConvertSettings};

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

/// Converts the frames of a job.
#[derive(Debug, Clone, Copy)]
pub struct ConvertWork<'a> {
    /// The settings that all frames share.
    pub conversion: &'a Conversion,
    /// The frames of the input.
    pub sequence: &'a Sequence,
    /// The native frames, in the order of the frames of the run.
    pub tasks: &'a [ConvertTask],
}

impl FrameWork for ConvertWork<'_> {
    type Report = ConvertedFrame;

    fn process(
        &self,
        frame: &ClaimedFrame,
        context: &RunContext<'_, ConvertedFrame>,
    ) -> Result<FinishedFrame<ConvertedFrame>, FrameFailure> {
        let task = &self.tasks[frame.index];
        context.report_stage(task.frame, "converting");
        let progress = FrameProgress { frame: task.frame, context };
        let converted = convert_frame(self.conversion, self.sequence, task, &progress);
        let mut report = converted
            .map_err(|e| ConversionError::new(e, self.sequence, task.index).into_failure(task))?;
        context.report_notes(report.notes.drain(..));
        Ok(FinishedFrame { outputs: vec![task.output.clone()], report })
    }
}

/// Reports the phases of one frame.
struct FrameProgress<'a> {
    frame: i64,
    context: &'a RunContext<'a, ConvertedFrame>,
}

impl Progress for FrameProgress<'_> {
    fn advanced(&self, phase: Phase, done: u64, total: u64) -> ControlFlow<()> {
        let percent = 100 * u128::from(done) / u128::from(total).max(1);
        let stage = format!("converting ({} {percent} %)", phase.name());
        self.context.report_stage(self.frame, &stage);
        ControlFlow::Continue(())
    }
}
