//! The three stages of a sequence: while frame i is traced, frame i+1 is read and frame i-1 is encoded and written.
//!
//! One frame is in flight per stage, handed over without a queue, so memory is constant however long the sequence is.
//! Reading waits until the tree of the previous frame is built: building takes little time, and releases the
//! positions of that frame. Reading uses separate threads, so it never waits for tracing. The planes of a
//! written image are returned to the tracer. The last stage records every frame in the ledger of the job, after its
//! image. [`Setup`] defines the pictures in advance.

use std::collections::HashSet;
use std::panic;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;

use spherule_formats::sequence::Sequence;
use spherule_jobs::{Claim, FrameFailure, FrameQueue, Interrupt, Job, JobError, QueueEvent};

mod decoded;
mod encode;
mod error;
mod in_place;
mod load;
mod load_error;
mod memory_limit;
mod predict;
mod probe;
mod rays;
mod read_threads;
mod renderer;
mod schedule;
mod setup;
mod single;
mod surface;
mod trace;

pub use decoded::{DecodedFrame, DecodedShading};
pub use error::{ImageError, WriteError};
pub use in_place::{StoredFrame, StoredShading};
pub use load::{LoadedFrame, LoadedParticles, load_frame};
pub use load_error::LoadError;
pub(crate) use load_error::attribute_list;
pub use memory_limit::{MemoryLimitError, MemoryRemedy};
pub use predict::{FrameSize, MemoryModel, MemoryNeed};
pub use probe::{Probe, ProbeError, probe};
pub use renderer::{BuiltFrame, FrameRenderer, TraceError, TracedFrame};
pub use schedule::{Overlap, Schedule};
pub use setup::{ColorRule, Picture, RadiusRule, RunSettings, Setup};
pub use single::{PictureKind, make_image, make_picture};
pub use trace::{CpuRenderer, renderer_of};

use read_threads::ReadThreads;

use crate::failure::catch_panic;
use crate::render::{Film, Stop};
use crate::report::FrameReport;

/// One image to render.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageTask {
    /// Frame number.
    pub frame: i64,
    /// Index in the sequence.
    pub index: usize,
    /// Path of the EXR.
    pub image: PathBuf,
    /// Path of the optional PNG.
    pub preview: Option<PathBuf>,
    /// Why it cannot be rendered, if that is known in advance.
    pub refused: Option<MemoryLimitError>,
}

/// A stage of the pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Its files are being read.
    Read,
    /// Its tree is being built and its image traced.
    Trace,
    /// Its image is being encoded and written.
    Write,
}

/// Progress of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// A frame has entered a stage.
    StageEntered(i64, Stage),
    /// A frame's image exists and is recorded.
    Done(&'a ImageTask, &'a FrameReport),
    /// A frame failed, and the failure was recorded. The other frames continue.
    Failed(&'a FrameFailure),
    /// Another worker has finished a frame or holds one.
    OtherWorker(QueueEvent<'a>),
    /// A note for the user.
    Note(&'a str),
}

/// Receives events, from several threads.
pub type OnEvent<'a> = &'a (dyn Fn(Event) + Sync);

/// A frame between two stages, or the reason why it failed.
enum StageResult<T> {
    Frame(T),
    Failed(Box<(ImageTask, ImageError)>),
}

/// A frame between two stages, with the claim of this worker.
struct ClaimedFrame<T> {
    claim: Claim,
    result: StageResult<T>,
}

/// Renders those of `tasks` that no other worker holds, in order, and records each in `job`. Returns when all are
/// finished, by any worker. Once `interrupt` is raised, returns after the frames in progress, or drops them if the
/// interrupt says to stop now. Without `overlap`, a frame is read only when the memory of the one before is free.
///
/// # Errors
/// The ledger or the output cannot be written, for example because the disk is full.
pub fn run(
    setup: &Setup,
    sequence: &Sequence,
    tasks: &[ImageTask],
    overlap: Overlap,
    job: &mut Job,
    interrupt: &Interrupt,
    on_event: OnEvent,
) -> Result<(), JobError> {
    let has_failed = AtomicBool::new(false);
    let threads = ReadThreads::new();
    let mut read = Ok(());
    // Connect the stages; with capacity 0 a stage holds its result until the next stage is free
    let (to_trace, loaded) = sync_channel(0);
    let (to_write, traced) = sync_channel(0);
    let (continue_reading, may_continue) = sync_channel(1);
    let (films, spare) = channel();
    // The next frame is read when the tree is built, or without overlap when the image is written
    let (is_built, is_written, films) = match overlap {
        Overlap::Stages => (Some(continue_reading), None, Some(films)),
        Overlap::None => (None, Some(continue_reading), None),
    };
    let (starts, has_started) = sync_channel(0);
    let frames = tasks.iter().map(|task| task.frame);
    let queue = FrameQueue::new(job.claims(), frames, interrupt);
    let reader = ReadStage {
        setup,
        sequence,
        tasks,
        threads: &threads,
        next: ToTrace {
            to_trace,
            may_continue,
        },
        on_event,
    };
    let outcome = &mut read;
    let written = threads.scope(|first| {
        first.spawn(move |_| {
            let _ = starts.send(());
            *outcome = reader.run(queue);
        });
        // The first new thread reuses the memory that the survey has freed
        let _ = has_started.recv();
        thread::scope(|scope| {
            let writer_failed = &has_failed;
            let next = encode::AfterWrite { is_written, films };
            let writer = scope.spawn(move || {
                let result = encode::write_stage(setup, sequence, traced, &next, job, on_event);
                writer_failed.store(result.is_err(), Ordering::Relaxed);
                result
            });
            let stage = TraceStage {
                setup,
                stop: DropFrame {
                    has_failed: &has_failed,
                    interrupt,
                },
                interrupt,
                on_event,
            };
            stage.run(loaded, spare, is_built, to_write);
            join_result(writer.join())
        })
    });
    written.and(read)
}

fn join_result<T>(result: thread::Result<T>) -> T {
    result.unwrap_or_else(|payload| panic::resume_unwind(payload))
}

/// The first stage, see [`run`].
struct ReadStage<'a> {
    setup: &'a Setup,
    sequence: &'a Sequence,
    tasks: &'a [ImageTask],
    threads: &'a ReadThreads,
    next: ToTrace,
    on_event: OnEvent<'a>,
}

impl ReadStage<'_> {
    /// Runs on the thread of the first stage.
    fn run(&self, mut queue: FrameQueue) -> Result<(), JobError> {
        let mut notes = ReportedNotes::default();
        let mut on_queue_event = |event: QueueEvent| (self.on_event)(Event::OtherWorker(event));
        while let Some((index, claim)) = queue.next(&mut on_queue_event)? {
            let task = &self.tasks[index];
            (self.on_event)(Event::StageEntered(task.frame, Stage::Read));
            let loaded = match &task.refused {
                Some(error) => Err(error.clone().into()),
                None => catch_panic(|| self.load(task)),
            };
            let result = match loaded {
                Ok(mut frame) => {
                    notes.report(std::mem::take(&mut frame.notes), self.on_event);
                    StageResult::Frame(frame)
                }
                Err(error) => StageResult::Failed(Box::new((task.clone(), error))),
            };
            if !self.next.send(ClaimedFrame { claim, result }) {
                break;
            }
        }
        Ok(())
    }

    fn load(&self, task: &ImageTask) -> Result<LoadedFrame, ImageError> {
        let size = FrameSize::of(self.sequence, task.index, self.setup.run.weight.as_ref());
        let load = || load_frame(self.setup, self.sequence, task);
        Ok(self.threads.read(size.read_bytes(), load)?)
    }
}

/// The notes that a stage has reported. A note that all frames share is reported once.
#[derive(Default)]
struct ReportedNotes(HashSet<String>);

impl ReportedNotes {
    fn report(&mut self, notes: Vec<String>, on_event: OnEvent) {
        for note in notes {
            if !self.0.contains(&note) {
                on_event(Event::Note(&note));
                self.0.insert(note);
            }
        }
    }
}

/// The channels from reading to tracing.
struct ToTrace {
    to_trace: SyncSender<ClaimedFrame<LoadedFrame>>,
    /// Signals that there is memory for another frame.
    may_continue: Receiver<()>,
}

impl ToTrace {
    /// Sends the frame and waits until there is memory for another. Returns false once a later stage has ended.
    fn send(&self, frame: ClaimedFrame<LoadedFrame>) -> bool {
        self.to_trace.send(frame).is_ok() && self.may_continue.recv().is_ok()
    }
}

/// Runs `work` on a thread of the current pool, so that its time does not include the wait for a thread, and its
/// parallel parts are not submitted from outside the pool each time.
fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Stops tracing when frames can no longer be recorded, or when the interrupt says to stop now.
struct DropFrame<'a> {
    has_failed: &'a AtomicBool,
    interrupt: &'a Interrupt,
}

impl Stop for DropFrame<'_> {
    fn is_raised(&self) -> bool {
        self.has_failed.load(Ordering::Relaxed) || self.interrupt.stop_now()
    }
}

struct TraceStage<'a> {
    setup: &'a Setup,
    stop: DropFrame<'a>,
    interrupt: &'a Interrupt,
    on_event: OnEvent<'a>,
}

impl TraceStage<'_> {
    /// The neighbouring stages end when this one does, because it owns its ends of all channels.
    fn run(
        &self,
        loaded: Receiver<ClaimedFrame<LoadedFrame>>,
        spare: Receiver<Film>,
        is_built: Option<SyncSender<()>>,
        next: SyncSender<ClaimedFrame<TracedFrame>>,
    ) {
        let mut tracer = renderer_of(self.setup.picture.renderer);
        let mut notes = ReportedNotes::default();
        for ClaimedFrame { claim, result } in loaded {
            // Drop a frame that was read but not started when the interrupt was raised
            if self.interrupt.is_raised() {
                return;
            }
            let (task, built) = match result {
                StageResult::Frame(frame) => {
                    let task = frame.task.clone();
                    (self.on_event)(Event::StageEntered(task.frame, Stage::Trace));
                    let build = || tracer.prepare(self.setup, frame);
                    (task, catch_panic(|| Ok(in_pool(build)?)))
                }
                StageResult::Failed(failed) => {
                    let (task, error) = *failed;
                    (task, Err(error))
                }
            };
            if let Some(is_built) = &is_built {
                // The reader may have ended
                let _ = is_built.send(());
            }
            // Trace the image, in the planes of an earlier one
            let traced = built.and_then(|mut frame| {
                notes.report(std::mem::take(&mut frame.notes), self.on_event);
                if let Ok(film) = spare.try_recv() {
                    tracer.recycle(film);
                }
                let trace = || tracer.render(self.setup, frame, &self.stop);
                catch_panic(|| Ok(in_pool(trace)?))
            });
            let result = match traced {
                Ok(traced) => StageResult::Frame(traced),
                Err(_) if self.stop.is_raised() => return,
                Err(error) => {
                    // The failure may have left the buffers in an inconsistent state
                    tracer = renderer_of(self.setup.picture.renderer);
                    StageResult::Failed(Box::new((task, error)))
                }
            };
            if is_built.is_none() {
                tracer = renderer_of(self.setup.picture.renderer);
            }
            if next.send(ClaimedFrame { claim, result }).is_err() {
                return;
            }
        }
    }
}
