//! The three stages of a sequence: while frame i is traced, frame i+1 is read and frame i-1 is
//! encoded and written.
//!
//! One frame is in flight in each stage, handed over without a queue, so memory is flat however long the
//! sequence. Reading waits until the tree over the frame before is built: building is short, and only then are
//! that frame's positions let go. It has threads of its own, so that it waits for nothing else. The planes of a
//! written image go back to the tracer. The last stage records every frame in the job's ledger, image first. What
//! the picture looks like is settled before, in [`Setup`].

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

/// One image to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageTask {
    /// Frame number.
    pub frame: i64,
    /// Index in the sequence.
    pub index: usize,
    /// The EXR.
    pub image: PathBuf,
    /// The PNG beside it, if wanted.
    pub preview: Option<PathBuf>,
    /// Why it cannot be made, if that is known before.
    pub refused: Option<String>,
}

/// What a frame is going through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Its files are read.
    Read,
    /// Its tree is built and its image traced.
    Trace,
    /// Its image is encoded and written.
    Write,
}

/// What whoever watches is told.
#[derive(Debug)]
pub enum Event<'a> {
    /// A frame has entered a stage.
    Entered(i64, Stage),
    /// A frame's image is in place and recorded.
    Done(&'a ImageTask, &'a FrameReport),
    /// A frame could not be made; it is recorded with this reason and the rest goes on.
    Failed(i64, &'a str),
    /// Other workers are at frames of the run.
    Others(QueueNews<'a>),
    /// Something the user should know.
    Note(&'a str),
}

/// Who watches.
pub type Watch<'a> = &'a (dyn Fn(Event) + Sync);

/// A frame on its way, or why it fell out.
enum Passed<T> {
    Frame(T),
    Failed(ImageTask, String),
}

/// A frame on its way that no other worker does meanwhile.
struct InHand<T> {
    claim: Claim,
    passed: Passed<T>,
}

/// Renders those of `tasks` that no other worker does, in order, and records each in `job`; returns when all
/// are ended, by whomever. Ends early, with the frame in hand finished,
/// once `interrupt` is raised, and without it once it says to stop now. Without `overlap` a frame is read only when the one before is written
/// and nothing of it is left.
///
/// # Errors
/// The ledger cannot be written, or the disk is full: nothing further could be recorded.
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
    // Capacity 0: a stage holds its result until the next one is free to take it.
    let (to_trace, loaded) = sync_channel(0);
    let (to_write, traced) = sync_channel(0);
    let (go_on, room) = sync_channel(1);
    let (films, spare) = channel();
    // Whoever frees the memory that the next frame needs; without overlap no film is kept for it.
    let (is_built, is_written, films) = match overlap {
        Overlap::Stages => (Some(go_on), None, Some(films)),
        Overlap::None => (None, Some(go_on), None),
    };
    let (begins, has_begun) = sync_channel(0);
    let frames = tasks.iter().map(|task| task.frame);
    let queue = Queue::new(job.claims(), frames, interrupt);
    let reader = ReadStage {
        setup,
        sequence,
        tasks,
        threads: &threads,
        next: Next { to_trace, room },
        watch,
    };
    let outcome = &mut read;
    let written = threads.scope(|first| {
        first.spawn(move |_| {
            let _ = begins.send(());
            *outcome = reader.run(queue);
        });
        // The first of the threads finds the memory that whoever looked at the frames has left.
        let _ = has_begun.recv();
        thread::scope(|scope| {
            let writer_ended = &is_over;
            let next = encode::Written { is_written, films };
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
            joined(writer.join())
        })
    });
    written.and(read)
}

fn joined<T>(result: thread::Result<T>) -> T {
    result.unwrap_or_else(|fault| panic::resume_unwind(fault))
}

/// The first stage; see [`run`].
struct ReadStage<'a> {
    setup: &'a Setup,
    sequence: &'a Sequence,
    tasks: &'a [ImageTask],
    threads: &'a ReadThreads,
    next: Next,
    watch: Watch<'a>,
}

impl ReadStage<'_> {
    /// Runs on the thread of the first stage.
    fn run(&self, mut queue: Queue) -> Result<(), JobError> {
        let mut told = Told::default();
        let mut heard = |news: QueueNews| (self.watch)(Event::Others(news));
        while let Some((place, claim)) = queue.take(&mut heard)? {
            let task = &self.tasks[place];
            (self.watch)(Event::Entered(task.frame, Stage::Read));
            let loaded = match &task.refused {
                Some(reason) => Err(reason.clone()),
                None => guarded(|| self.load(task)),
            };
            let passed = match loaded {
                Ok(mut frame) => {
                    told.tell(std::mem::take(&mut frame.notes), self.watch);
                    Passed::Frame(frame)
                }
                Err(reason) => Passed::Failed(task.clone(), reason),
            };
            if !self.next.pass_on(InHand { claim, passed }) {
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

/// What a stage has told of its frames: what is so in every frame is said once.
#[derive(Default)]
struct Told(HashSet<String>);

impl Told {
    fn tell(&mut self, notes: Vec<String>, watch: Watch) {
        for note in notes {
            if !self.0.contains(&note) {
                watch(Event::Note(&note));
                self.0.insert(note);
            }
        }
    }
}

/// The way from reading to tracing.
struct Next {
    to_trace: SyncSender<InHand<LoadedFrame>>,
    /// Tells when there is memory for another frame.
    room: Receiver<()>,
}

impl Next {
    /// Hands over and waits until there is room again; false once a later stage has ended.
    fn pass_on(&self, frame: InHand<LoadedFrame>) -> bool {
        self.to_trace.send(frame).is_ok() && self.room.recv().is_ok()
    }
}

/// Runs `work` on a thread of the current pool: its time begins when it does, and what it does in parallel is
/// not handed over from outside each time.
fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// When the frame that is traced is dropped: nothing further can be recorded, or there is no time for it.
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
    /// Its neighbours end when it does: it owns its ends of all channels.
    fn run(
        &self,
        loaded: Receiver<InHand<LoadedFrame>>,
        spare: Receiver<Film>,
        is_built: Option<SyncSender<()>>,
        next: SyncSender<InHand<TracedFrame>>,
    ) {
        let mut tracer = renderer_of(self.setup.picture.renderer);
        let mut told = Told::default();
        for InHand { claim, passed } in loaded {
            // A frame that was only read when the interrupt came is dropped, not begun.
            if self.interrupt.is_raised() {
                return;
            }
            let (task, built) = match passed {
                Passed::Frame(frame) => {
                    let task = frame.task.clone();
                    (self.watch)(Event::Entered(task.frame, Stage::Trace));
                    let build = || tracer.prepare(self.setup, frame);
                    (task, guarded(|| in_pool(build).map_err(|e| e.to_string())))
                }
                Passed::Failed(task, reason) => (task, Err(reason)),
            };
            if let Some(is_built) = &is_built {
                // Who reads may have ended by now.
                let _ = is_built.send(());
            }
            let traced = built.and_then(|mut frame| {
                told.tell(std::mem::take(&mut frame.notes), self.watch);
                if let Ok(film) = spare.try_recv() {
                    tracer.recycle(film);
                }
                let trace = || tracer.render(self.setup, frame, &self.stop);
                guarded(|| in_pool(trace).map_err(|e| e.to_string()))
            });
            let passed = match traced {
                Ok(traced) => Passed::Frame(traced),
                Err(_) if self.stop.is_raised() => return,
                Err(reason) => {
                    // Whatever happened may have left the buffers half filled.
                    tracer = renderer_of(self.setup.picture.renderer);
                    Passed::Failed(task, reason)
                }
            };
            if is_built.is_none() {
                tracer = renderer_of(self.setup.picture.renderer);
            }
            if next.send(InHand { claim, passed }).is_err() {
                return;
            }
        }
    }
}
