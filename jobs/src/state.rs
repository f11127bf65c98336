//! The state of a job: plan, ledger, and the outputs that exist on disk.

use std::collections::BTreeMap;
use std::fs;
use std::panic;
use std::path::{Path, PathBuf};
use std::thread;

use crate::{EntryStatus, Ledger, LedgerEntry, OutputFile, Plan, PlannedFrame};

/// The state of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameState {
    /// Not tried yet.
    Pending,
    /// Failed; the ledger entry has the reason.
    Failed,
    /// Was done, but a requested output is missing, has another length, or was written under another name.
    Lost,
    /// Done, and all requested outputs exist.
    Done,
}

/// Counts of frames by state.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JobSummary {
    /// All frames.
    pub total: usize,
    /// Done, and the outputs exist.
    pub done: usize,
    /// Not tried, or lost.
    pub pending: usize,
    /// Done, but outputs are missing. These frames are included in `pending`. Ascending.
    pub lost: Vec<i64>,
    /// Failed frames, ascending.
    pub failed: Vec<i64>,
}

/// The state of a job on disk.
#[derive(Debug, Clone)]
pub struct JobState {
    pub(crate) dir: PathBuf,
    pub(crate) plan: Plan,
    pub(crate) ledger: Ledger,
    pub(crate) states: BTreeMap<i64, FrameState>,
}

impl JobState {
    pub(crate) fn new(dir: &Path, plan: Plan, ledger: Ledger) -> Self {
        let states = frame_states(dir, plan.frames(), &ledger);
        Self { dir: dir.to_owned(), plan, ledger, states }
    }

    /// The directory of the job.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The plan.
    pub const fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The ledgers of all workers, merged.
    pub const fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The state of `frame`; None if it is not in the plan.
    pub fn frame_state(&self, frame: i64) -> Option<FrameState> {
        self.states.get(&frame).copied()
    }

    /// Counts all frames of the plan by state.
    pub fn summary(&self) -> JobSummary {
        self.summary_of(self.states.keys().copied())
    }

    /// Counts `frames` by state. Frames that are not in the plan are ignored.
    pub fn summary_of(&self, frames: impl IntoIterator<Item = i64>) -> JobSummary {
        let mut summary = JobSummary::default();
        for frame in frames {
            let Some(state) = self.frame_state(frame) else {
                continue;
            };
            summary.total += 1;
            match state {
                FrameState::Done => summary.done += 1,
                FrameState::Failed => summary.failed.push(frame),
                FrameState::Pending => summary.pending += 1,
                FrameState::Lost => {
                    summary.pending += 1;
                    summary.lost.push(frame);
                }
            }
        }
        summary.lost.sort_unstable();
        summary.failed.sort_unstable();
        summary
    }

    pub(crate) fn is_done(&self, frame: i64) -> bool {
        self.frame_state(frame) == Some(FrameState::Done)
    }
}

/// Threads that check outputs. Most of their time they wait for a network file system.
const MAX_THREADS: usize = 8;

/// Frames per thread, at least.
const MIN_FRAMES_PER_THREAD: usize = 256;

/// Checks the outputs of all frames.
fn frame_states(dir: &Path, frames: &[PlannedFrame], ledger: &Ledger) -> BTreeMap<i64, FrameState> {
    let check = |chunk: &[PlannedFrame]| -> Vec<(i64, FrameState)> {
        let state = |f: &PlannedFrame| (f.number, frame_state(dir, f, ledger.entry(f.number)));
        chunk.iter().map(state).collect()
    };
    let chunk_size = frames.len().div_ceil(MAX_THREADS).max(MIN_FRAMES_PER_THREAD);
    thread::scope(|scope| {
        let threads: Vec<_> =
            frames.chunks(chunk_size).map(|chunk| scope.spawn(move || check(chunk))).collect();
        let states = threads
            .into_iter()
            .map(|thread| thread.join().unwrap_or_else(|e| panic::resume_unwind(e)));
        states.flatten().collect()
    })
}

/// A frame is done only if it was written under the names in the plan.
fn frame_state(dir: &Path, planned: &PlannedFrame, entry: Option<&LedgerEntry>) -> FrameState {
    let exists = |file: &OutputFile| {
        fs::metadata(dir.join(&file.path)).is_ok_and(|m| m.is_file() && m.len() == file.len)
    };
    match entry {
        None => FrameState::Pending,
        Some(entry) if entry.status == EntryStatus::Failed => FrameState::Failed,
        Some(entry) => {
            let written = |path: &String| entry.outputs.iter().find(|o| o.path == *path);
            if planned.outputs.iter().all(|p| written(p).is_some_and(exists)) {
                FrameState::Done
            } else {
                FrameState::Lost
            }
        }
    }
}
