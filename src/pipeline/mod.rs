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
use spherule_jobs::{Claim, Interrupt, Job, JobError, Queue, QueueNews};

mod decoded;
mod encode;
mod in_place;
mod load;
mod load_error;
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
pub use encode::encode_frame;
pub use in_place::{StoredFrame, StoredShading};
pub use load::{LoadedFrame, LoadedParticles, load_frame};
pub use load_error::LoadError;
pub(crate) use load_error::attribute_list;
pub use predict::{FrameSize, MemoryModel, MemoryNeed};
pub use probe::{Probe, probe};
pub use renderer::{BuiltFrame, FrameRenderer, TraceError, TracedFrame};
pub use schedule::{Overlap, Schedule};
pub use setup::{ColorRule, Picture, RadiusRule, RunSettings, Setup};
pub use single::{PictureKind, SingleFault, make_image, make_picture};
pub use trace::{CpuRenderer, renderer_of};

use read_threads::ReadThreads;

use crate::mishap::guarded;
use crate::render::{Film, Stop};
use crate::report::FrameReport;

/// One image to be made.
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
    /// Reason why it cannot be made, if that is known in advance.
    pub refused: Option<String>,
}

/// Stage of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Its files are being read.
    Read,
    /// Its tree is being built and its image traced.
    Trace,
    /// Its image is being encoded and written.
    Write,
}

/// Events of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// A frame has entered a stage.
    Entered(i64, Stage),
    /// The image of a frame is complete and recorded.
    Done(&'a ImageTask, &'a FrameReport),
    /// A frame failed. It is recorded with this reason, and the run continues.
    Failed(i64, &'a str),
    /// Other workers are working on frames of the run.
    Others(QueueNews<'a>),
    /// A note for the user.
    Note(&'a str),
}

/// An event handler.
pub type Watch<'a> = &'a (dyn Fn(Event) + Sync);

/// A frame between two stages, or the reason of its failure.
enum StageResult<T> {
    Frame(T),
    Failed(ImageTask, String),
}

/// A frame between two stages that this worker has claimed.
struct ClaimedFrame<T> {
    claim: Claim,
    result: StageResult<T>,
}

/// Renders those of `tasks` that no other worker has claimed, in order, and records each in `job`. Returns when all
/// of them are finished, by any worker. If `interrupt` is raised, finishes only the current frame; if it requests an
/// immediate stop, drops that frame too. Without `overlap` a frame is read only after the previous one has been
/// written and released.
///
/// # Errors
/// The ledger cannot be written, or the disk is full: further frames could not be recorded.
pub fn run(
    setup: &Setup,
    sequence: &Sequence,
    tasks: &[ImageTask],
    overlap: Overlap,
    job: &mut Job,
    interrupt: &Interrupt,
    watch: Watch,
) -> Result<(), JobError> {
    let is_over = AtomicBool::new(false);
    let threads = ReadThreads::new();
    let mut read = Ok(());
    // Connect the stages; with capacity 0 a stage holds its result until the next stage is free
    let (to_trace, loaded) = sync_channel(0);
    let (to_write, traced) = sync_channel(0);
    let (memory_freed, has_memory) = sync_channel(1);
    let (films, spare) = channel();
    // Select the stage that lets the next frame be read, because it frees the memory; without overlap no film is kept
    let (is_built, is_written, films) = match overlap {
        Overlap::Stages => (Some(memory_freed), None, Some(films)),
        Overlap::None => (None, Some(memory_freed), None),
    };
    // Start the reader
    let (reader_started, reader_running) = sync_channel(0);
    let frames = tasks.iter().map(|task| task.frame);
    let queue = Queue::new(job.claims(), frames, interrupt);
    let reader = ReadStage {
        setup,
        sequence,
        tasks,
        threads: &threads,
        next: TraceHandover {
            to_trace,
            has_memory,
        },
        watch,
    };
    let outcome = &mut read;
    let written = threads.scope(|first| {
        first.spawn(move |_| {
            let _ = reader_started.send(());
            *outcome = reader.run(queue);
        });
        // Wait until the reader runs, so that its first thread reuses the memory that the survey of the frames has
        // freed.
        let _ = reader_running.recv();
        thread::scope(|scope| {
            // Start the writer, and trace on this thread
            let writer_ended = &is_over;
            let next = encode::WriteSignals { is_written, films };
            let writer = scope.spawn(move || {
                let ended = encode::write_stage(setup, traced, &next, job, watch);
                writer_ended.store(ended.is_err(), Ordering::Relaxed);
                ended
            });
            let stage = TraceStage {
                setup,
                stop: DropFrame {
                    is_over: &is_over,
                    interrupt,
                },
                interrupt,
                watch,
            };
            stage.run(loaded, spare, is_built, to_write);
            join_result(writer.join())
        })
    });
    written.and(read)
}

fn join_result<T>(result: thread::Result<T>) -> T {
    result.unwrap_or_else(|fault| panic::resume_unwind(fault))
}

/// The first stage, see [`run`].
struct ReadStage<'a> {
    setup: &'a Setup,
    sequence: &'a Sequence,
    tasks: &'a [ImageTask],
    threads: &'a ReadThreads,
    next: TraceHandover,
    watch: Watch<'a>,
}

impl ReadStage<'_> {
    /// Reads frame after frame, on the thread of the first stage.
    fn run(&self, mut queue: Queue) -> Result<(), JobError> {
        let mut reported = ReportedNotes::default();
        let mut on_news = |news: QueueNews| (self.watch)(Event::Others(news));
        while let Some((index, claim)) = queue.take(&mut on_news)? {
            // Read the frame, unless it is known to fail
            let task = &self.tasks[index];
            (self.watch)(Event::Entered(task.frame, Stage::Read));
            let loaded = match &task.refused {
                Some(reason) => Err(reason.clone()),
                None => guarded(|| self.load(task)),
            };
            // Report its notes, and pass it on
            let result = match loaded {
                Ok(mut frame) => {
                    reported.report_new(std::mem::take(&mut frame.notes), self.watch);
                    StageResult::Frame(frame)
                }
                Err(reason) => StageResult::Failed(task.clone(), reason),
            };
            if !self.next.send(ClaimedFrame { claim, result }) {
                break;
            }
        }
        Ok(())
    }

    fn load(&self, task: &ImageTask) -> Result<LoadedFrame, String> {
        let size = FrameSize::of(self.sequence, task.index, self.setup.run.weight.as_ref());
        let load = || load_frame(self.setup, self.sequence, task);
        let loaded = self.threads.read(size.read_bytes(), load);
        loaded.map_err(|e| e.to_string())
    }
}

/// Notes that a stage has reported already: a note that applies to every frame is reported once.
#[derive(Default)]
struct ReportedNotes(HashSet<String>);

impl ReportedNotes {
    fn report_new(&mut self, notes: Vec<String>, watch: Watch) {
        for note in notes {
            if !self.0.contains(&note) {
                watch(Event::Note(&note));
                self.0.insert(note);
            }
        }
    }
}

/// Connection from reading to tracing.
struct TraceHandover {
    to_trace: SyncSender<ClaimedFrame<LoadedFrame>>,
    /// Receives a message when there is memory for another frame.
    has_memory: Receiver<()>,
}

impl TraceHandover {
    /// Passes a frame on, and waits until there is memory for another one; false if a later stage has ended.
    fn send(&self, frame: ClaimedFrame<LoadedFrame>) -> bool {
        self.to_trace.send(frame).is_ok() && self.has_memory.recv().is_ok()
    }
}

/// Runs `work` on a thread of the current pool, so that its time does not include the wait for a thread, and its
/// parallel parts are not submitted from outside the pool each time.
fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Stops the frame that is being traced if further frames cannot be recorded, or if an immediate stop is requested.
struct DropFrame<'a> {
    is_over: &'a AtomicBool,
    interrupt: &'a Interrupt,
}

impl Stop for DropFrame<'_> {
    fn is_raised(&self) -> bool {
        self.is_over.load(Ordering::Relaxed) || self.interrupt.stop_now()
    }
}

struct TraceStage<'a> {
    setup: &'a Setup,
    stop: DropFrame<'a>,
    interrupt: &'a Interrupt,
    watch: Watch<'a>,
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
        let mut reported = ReportedNotes::default();
        for ClaimedFrame { claim, result } in loaded {
            // A frame that has only been read when the interrupt comes is dropped.
            if self.interrupt.is_raised() {
                return;
            }
            // Build the tree, and let the next frame be read
            let (task, built) = match result {
                StageResult::Frame(frame) => {
                    let task = frame.task.clone();
                    (self.watch)(Event::Entered(task.frame, Stage::Trace));
                    let build = || tracer.prepare(self.setup, frame);
                    (task, guarded(|| in_pool(build).map_err(|e| e.to_string())))
                }
                StageResult::Failed(task, reason) => (task, Err(reason)),
            };
            if let Some(is_built) = &is_built {
                // The reader may have ended.
                let _ = is_built.send(());
            }
            // Trace the image, in the planes of an earlier one
            let traced = built.and_then(|mut frame| {
                reported.report_new(std::mem::take(&mut frame.notes), self.watch);
                if let Ok(film) = spare.try_recv() {
                    tracer.recycle(film);
                }
                let trace = || tracer.render(self.setup, frame, &self.stop);
                guarded(|| in_pool(trace).map_err(|e| e.to_string()))
            });
            let result = match traced {
                Ok(traced) => StageResult::Frame(traced),
                Err(_) if self.stop.is_raised() => return,
                Err(reason) => {
                    // The failure may have left its buffers in an invalid state.
                    tracer = renderer_of(self.setup.picture.renderer);
                    StageResult::Failed(task, reason)
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
