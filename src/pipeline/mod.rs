//! The three stages of a sequence: while frame i is traced, frame i+1 is read and frame i-1 is
//! encoded and written.
//!
//! One frame is in flight in each stage, handed over without a queue, so memory is flat however
//! long the sequence. The last stage records every frame in the job's ledger, image first. What
//! the picture looks like is settled before, in [`Setup`].

use std::collections::HashSet;
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use spherule_formats::sequence::Sequence;
use spherule_jobs::{Interrupt, Job, JobError};

mod encode;
mod load;
mod rays;
mod setup;
mod trace;

pub use encode::encode_frame;
pub(crate) use load::attribute_list;
pub use load::{LoadError, LoadedFrame, load_frame};
pub use setup::{ColorRule, RadiusRule, Setup};
pub use trace::{FrameTracer, TracedFrame};

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

/// Renders `tasks` in order and records each in `job`. Ends early, with the frame in hand finished,
/// once `interrupt` is raised.
///
/// # Errors
/// The ledger cannot be written, or the disk is full: nothing further could be recorded.
pub fn run(
    setup: &Setup,
    sequence: &Sequence,
    tasks: &[ImageTask],
    job: &mut Job,
    interrupt: &Interrupt,
    watch: Watch,
) -> Result<(), JobError> {
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        // Capacity 0: a stage holds its result until the next one is free to take it.
        let (to_trace, loaded) = sync_channel(0);
        let (to_write, traced) = sync_channel(0);
        scope.spawn(move || read_stage(setup, sequence, tasks, interrupt, &to_trace, watch));
        let stop_all = &stop;
        let writer = scope.spawn(move || {
            let ended = encode::write_stage(setup, traced, job, watch);
            stop_all.store(ended.is_err(), Ordering::Relaxed);
            ended
        });
        trace_stage(setup, loaded, to_write, &stop, interrupt, watch);
        writer
            .join()
            .unwrap_or_else(|fault| panic::resume_unwind(fault))
    })
}

fn read_stage(
    setup: &Setup,
    sequence: &Sequence,
    tasks: &[ImageTask],
    interrupt: &Interrupt,
    next: &SyncSender<Passed<LoadedFrame>>,
    watch: Watch,
) {
    let mut told = HashSet::new();
    for task in tasks {
        if interrupt.is_raised() {
            return;
        }
        watch(Event::Entered(task.frame, Stage::Read));
        let loaded = guarded(|| load_frame(setup, sequence, task).map_err(|e| e.to_string()));
        let passed = match loaded {
            Ok(mut frame) => {
                // What is so in every frame is said once.
                for note in std::mem::take(&mut frame.notes) {
                    if !told.contains(&note) {
                        watch(Event::Note(&note));
                        told.insert(note);
                    }
                }
                Passed::Frame(frame)
            }
            Err(reason) => Passed::Failed(task.clone(), reason),
        };
        // An error means that the next stage has ended: so do we.
        if next.send(passed).is_err() {
            return;
        }
    }
}

fn trace_stage(
    setup: &Setup,
    loaded: Receiver<Passed<LoadedFrame>>,
    next: SyncSender<Passed<TracedFrame>>,
    stop: &AtomicBool,
    interrupt: &Interrupt,
    watch: Watch,
) {
    let mut tracer = FrameTracer::new();
    for passed in loaded {
        // A frame that was only read when the interrupt came is dropped, not begun.
        if interrupt.is_raised() {
            return;
        }
        let passed = match passed {
            Passed::Frame(frame) => {
                let task = frame.task.clone();
                watch(Event::Entered(task.frame, Stage::Trace));
                let traced =
                    guarded(|| tracer.trace(setup, frame, stop).map_err(|e| e.to_string()));
                match traced {
                    Ok(traced) => Passed::Frame(traced),
                    Err(_) if stop.load(Ordering::Relaxed) => return,
                    Err(reason) => {
                        // Whatever happened may have left the buffers half filled.
                        tracer = FrameTracer::new();
                        Passed::Failed(task, reason)
                    }
                }
            }
            Passed::Failed(task, reason) => Passed::Failed(task, reason),
        };
        if next.send(passed).is_err() {
            return;
        }
    }
}

/// Runs the work of one frame; a panic in it is a fault of ours that costs this frame and no other.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|fault| {
        let text = fault
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| fault.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given");
        Err(format!(
            "a fault in spherule itself, please report it: {text}"
        ))
    })
}
