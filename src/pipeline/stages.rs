//! The stages of a run, which pass frames on. See [`super::work`].

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender};

use spherule_files::memory::MemoryPeaks;
use spherule_formats::sequence::Sequence;
use spherule_jobs::{
    FinishedFrame, FrameFailure, FrameQueue, Interrupt, JobError, RunContext, catch_panic,
};

use super::encode::{lock_peaks, write_frame};
use super::read_threads::ReadThreads;
use super::record::{AtEncoder, EncodedFrame, NotEncoded, StagedFrame, ToEncoders};
use super::{
    FrameSize, ImageError, ImageTask, LoadedFrame, Setup, TracedFrame, load_frame, renderer_of,
};
use crate::render::{Film, Stop};
use crate::report::FrameReport;

/// The first stage.
pub(super) struct ReadStage<'a> {
    pub(super) setup: &'a Setup,
    pub(super) sequence: &'a Sequence,
    pub(super) tasks: &'a [ImageTask],
    pub(super) threads: &'a ReadThreads,
    pub(super) context: &'a RunContext<'a, FrameReport>,
    pub(super) next: ToTrace,
}

impl ReadStage<'_> {
    /// Runs on the thread of the first stage.
    pub(super) fn run(&self, queue: &mut FrameQueue<'_>) -> Result<(), JobError> {
        while let Some(claimed) = queue.next()? {
            let task = &self.tasks[claimed.index];
            self.context.report_stage(task.frame, "reading");
            let loaded = catch_panic(|| self.load(task)).map(|mut frame| {
                self.context.report_notes(frame.notes.drain(..));
                frame
            });
            let result = loaded.map_err(|e| e.into_failure(task.frame));
            if !self.next.send(StagedFrame { claimed, result }) {
                break;
            }
        }
        Ok(())
    }

    fn load(&self, task: &ImageTask) -> Result<LoadedFrame<'static>, ImageError> {
        task.check()?;
        let size = FrameSize::of_task(self.sequence, task, self.setup);
        let load = || load_frame(self.setup, self.sequence, task);
        Ok(self.threads.read(size.read_bytes(), load)?)
    }
}

/// The channels from reading to tracing.
pub(super) struct ToTrace {
    pub(super) to_trace: SyncSender<StagedFrame<LoadedFrame<'static>>>,
    /// Signals that there is memory for another frame.
    pub(super) may_continue: Receiver<()>,
}

impl ToTrace {
    /// Sends the frame and waits until there is memory for another. Returns false once a later stage has ended.
    fn send(&self, frame: StagedFrame<LoadedFrame<'static>>) -> bool {
        self.to_trace.send(frame).is_ok() && self.may_continue.recv().is_ok()
    }
}

/// Runs `work` on a thread of the current pool, so that its time does not include the wait for a thread, and its
/// parallel parts are not submitted from outside the pool each time.
fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Stops tracing when frames can no longer be recorded, or when the interrupt says to stop now.
pub(super) struct DropFrame<'a> {
    pub(super) has_failed: &'a AtomicBool,
    pub(super) interrupt: &'a Interrupt,
}

impl Stop for DropFrame<'_> {
    fn is_raised(&self) -> bool {
        self.has_failed.load(Ordering::Relaxed) || self.interrupt.stop_now()
    }
}

/// The second stage.
pub(super) struct TraceStage<'a> {
    pub(super) setup: &'a Setup,
    pub(super) context: &'a RunContext<'a, FrameReport>,
    pub(super) stop: DropFrame<'a>,
}

impl TraceStage<'_> {
    /// The neighbouring stages end when this one does, because it owns its ends of all channels.
    pub(super) fn run(
        &self,
        loaded: Receiver<StagedFrame<LoadedFrame<'static>>>,
        spare: Receiver<Film>,
        is_built: Option<SyncSender<()>>,
        mut next: ToEncoders,
    ) {
        let read_next = || {
            if let Some(is_built) = &is_built {
                // The reader may have ended
                let _ = is_built.send(());
            }
        };
        let reads_early = self.setup.reads_while_building();
        let mut tracer = renderer_of(self.setup.picture.renderer);
        for StagedFrame { claimed, result } in loaded {
            // Drop a frame that was read but not started when the interrupt was raised
            if self.context.interrupt().is_raised() {
                return;
            }
            let number = claimed.frame;
            let failure = |error: ImageError| error.into_failure(number);
            if reads_early {
                read_next();
            }
            let built = result.and_then(|frame| {
                self.context.report_stage(number, "tracing");
                let build = || tracer.prepare(self.setup, frame);
                catch_panic(|| Ok(in_pool(build)?)).map_err(failure)
            });
            if !reads_early {
                read_next();
            }
            // Trace the image, in the planes of an earlier one
            let traced = built.and_then(|mut frame| {
                self.context.report_notes(frame.notes.drain(..));
                if let Ok(film) = spare.try_recv() {
                    tracer.recycle(film);
                }
                let trace = || {
                    if self.setup.finishes_when_encoding() {
                        tracer.trace(self.setup, &frame, &self.stop)
                    } else {
                        tracer.render(self.setup, &frame, &self.stop)
                    }
                };
                catch_panic(|| Ok(in_pool(trace)?)).map_err(failure)
            });
            if traced.is_err() {
                if self.stop.is_raised() {
                    return;
                }
                // The failure may have left the buffers in an inconsistent state
                tracer = renderer_of(self.setup.picture.renderer);
            }
            if is_built.is_none() {
                tracer = renderer_of(self.setup.picture.renderer);
            }
            let result = traced;
            if !next.send(StagedFrame { claimed, result }) {
                return;
            }
        }
    }
}

/// The third stage: encodes images and publishes their files, several at the same time. Those of a GPU are finished
/// before.
pub(super) struct EncodeStage<'a> {
    pub(super) setup: &'a Setup,
    pub(super) context: &'a RunContext<'a, FrameReport>,
    /// Whether the sequence maps its files.
    pub(super) maps_files: bool,
    pub(super) peaks: &'a Mutex<MemoryPeaks>,
    /// To the tracer: reuse the planes. Without overlap their memory is released.
    pub(super) films: Option<Sender<Film>>,
}

impl EncodeStage<'_> {
    /// Runs on the thread of an encoder; ends when there are no more images, or when nothing can be recorded.
    pub(super) fn run(
        &self,
        traced: Receiver<AtEncoder<StagedFrame<TracedFrame>>>,
        next: Sender<AtEncoder<EncodedFrame>>,
    ) {
        for AtEncoder { place, encoder, frame: StagedFrame { claimed, result } } in traced {
            let result = result.map_err(NotEncoded::Failed).and_then(|frame| {
                if !claimed.is_held() {
                    return Err(NotEncoded::NotHeld);
                }
                self.write(frame).map_err(NotEncoded::Failed)
            });
            let frame = EncodedFrame { claimed, result };
            if next.send(AtEncoder { place, encoder, frame }).is_err() {
                return;
            }
        }
    }

    /// Writes the image, and returns its planes to the tracer.
    fn write(&self, mut frame: TracedFrame) -> Result<FinishedFrame<FrameReport>, FrameFailure> {
        let (number, outputs) = (frame.task.frame, frame.task.outputs());
        if self.maps_files {
            lock_peaks(self.peaks).use_samples_only();
        }
        let write = || {
            if self.setup.finishes_when_encoding() {
                in_pool(|| frame.finish(self.setup))?;
            }
            self.context.report_stage(number, "writing");
            Ok(write_frame(self.setup, frame, self.peaks)?)
        };
        let (report, film) =
            catch_panic(write).map_err(|error: ImageError| error.into_failure(number))?;
        if let Some(films) = &self.films {
            let _ = films.send(film);
        }
        Ok(FinishedFrame { outputs, report })
    }
}
