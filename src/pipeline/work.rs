//! The three stages of a run: while frame i is traced, frame i+1 is read and frame i-1 is encoded and written.
//!
//! One frame is in flight per stage, handed over without a queue, so memory is constant however long the sequence is.
//! Where encoding is the slowest stage, a fixed number of images are encoded at the same time. Reading waits until the
//! tree of the previous frame is built: building takes little time, and releases the positions of that frame. On a GPU,
//! it does not wait. Reading has threads of its own, so that it never waits for tracing. The planes of a
//! written image are returned to the tracer. One thread records every frame in the job, after its image and in the order
//! of the run.

use std::panic;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;

use spherule_formats::sequence::Sequence;
use spherule_jobs::{
    ClaimedFrame, FinishedFrame, FrameFailure, FrameQueue, FrameRecorder, FrameWork, JobError,
    RunContext,
};

use super::read_threads::ReadThreads;
use super::record::{RecordStage, StagedFrame, ToEncoders};
use super::stages::{DropFrame, EncodeStage, ReadStage, ToTrace, TraceStage};
use super::{ImageTask, LoadedFrame, Overlap, Setup, make_image};
use crate::report::FrameReport;

/// Renders the frames of a job in this process.
#[derive(Debug, Clone, Copy)]
pub struct RenderWork<'a> {
    /// Defines the images.
    pub setup: &'a Setup,
    /// The frames of the input.
    pub sequence: &'a Sequence,
    /// The images, in the order of the frames of the run.
    pub tasks: &'a [ImageTask],
    /// Whether several frames are in flight. Otherwise a frame is read only when the memory of the one before is
    /// free.
    pub overlap: Overlap,
    /// How many images are encoded at the same time at most.
    pub encoders: u32,
}

impl FrameWork for RenderWork<'_> {
    type Report = FrameReport;

    fn process(
        &self,
        frame: &ClaimedFrame,
        context: &RunContext<'_, FrameReport>,
    ) -> Result<FinishedFrame<FrameReport>, FrameFailure> {
        let task = &self.tasks[frame.index];
        context.report_stage(task.frame, "rendering");
        let report = make_image(self.setup, self.sequence, task, |n| context.report_note(n));
        Ok(FinishedFrame {
            outputs: task.outputs(),
            report: report.map_err(|e| e.into_failure(task.frame))?,
        })
    }

    fn process_all(
        &self,
        queue: &mut FrameQueue<'_>,
        recorder: &mut FrameRecorder<'_, FrameReport>,
    ) -> Result<(), JobError> {
        let context = recorder.context();
        let threads = ReadThreads::new();
        let mut read = Ok(());
        // Connect reader and tracer; with capacity 0 a stage holds its result until the next stage is free
        let (to_trace, loaded) = sync_channel(0);
        let (continue_reading, may_continue) = sync_channel(1);
        // The next frame is read when the tree is built, or without overlap when the image is written
        let (is_built, is_written) = match self.overlap {
            Overlap::Stages => (Some(continue_reading), None),
            Overlap::None => (None, Some(continue_reading)),
        };
        // Read in a thread, and trace in this one
        let (starts, has_started) = sync_channel(0);
        let reader = ReadStage {
            setup: self.setup,
            sequence: self.sequence,
            tasks: self.tasks,
            threads: &threads,
            context,
            next: ToTrace { to_trace, may_continue },
        };
        let outcome = &mut read;
        let written = threads.scope(|first| {
            first.spawn(move |_| {
                let _ = starts.send(());
                *outcome = reader.run(queue);
            });
            // The first new thread reuses the memory that the survey has freed
            let _ = has_started.recv();
            self.trace_and_encode(loaded, is_built, is_written, recorder)
        });
        written.and(read)
    }
}

impl RenderWork<'_> {
    /// Runs the second and the third stage. `is_built` and `is_written` tell the reader that there is memory for
    /// another frame.
    fn trace_and_encode(
        &self,
        loaded: Receiver<StagedFrame<LoadedFrame<'static>>>,
        is_built: Option<SyncSender<()>>,
        is_written: Option<SyncSender<()>>,
        recorder: &mut FrameRecorder<'_, FrameReport>,
    ) -> Result<(), JobError> {
        let context = recorder.context();
        let has_failed = AtomicBool::new(false);
        let peaks = Mutex::default();
        let (films, spare) = channel();
        let (to_record, encoded) = channel();
        let (freed, idle) = channel();
        thread::scope(|scope| {
            // Start the encoders
            let mut encoders = Vec::new();
            for _ in 0..self.encoders.max(1) {
                let (to_encode, traced) = sync_channel(0);
                encoders.push(to_encode);
                let stage = EncodeStage {
                    setup: self.setup,
                    context,
                    maps_files: self.sequence.maps_files(),
                    peaks: &peaks,
                    films: (self.overlap == Overlap::Stages).then(|| films.clone()),
                };
                let next = to_record.clone();
                scope.spawn(move || stage.run(traced, next));
            }
            // Encoders hold the only other ends of these channels
            drop((to_record, films));
            let record_failed = &has_failed;
            let stage = RecordStage { freed, is_written };
            let written = scope.spawn(move || {
                let result = stage.run(encoded, recorder);
                record_failed.store(result.is_err(), Ordering::Relaxed);
                result
            });
            // Trace on this thread
            let stage = TraceStage {
                setup: self.setup,
                context,
                stop: DropFrame { has_failed: &has_failed, interrupt: context.interrupt() },
            };
            stage.run(loaded, spare, is_built, ToEncoders::new(encoders, idle));
            join_result(written.join())
        })
    }
}

fn join_result<T>(result: thread::Result<T>) -> T {
    result.unwrap_or_else(|payload| panic::resume_unwind(payload))
}
