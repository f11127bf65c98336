//! How a job stands: plan and ledger together with what is really on the disk.

use std::collections::BTreeMap;
use std::fs;
use std::panic;
use std::path::{Path, PathBuf};
use std::thread;

use crate::{Entry, Ledger, OutputFile, Plan, PlannedFrame, Status};

/// How a frame stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameState {
    /// Not tried yet.
    Pending,
    /// Tried and failed; the reason is in its ledger entry.
    Failed,
    /// Was done, but an output that is wanted now is missing, has another length, or was not made
    /// under that name.
    Lost,
    /// Done, and all outputs wanted now are there.
    Done,
}

/// How many frames stand how.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Summary {
    /// Frames looked at.
    pub total: usize,
    /// Done, outputs in place.
    pub done: usize,
    /// Not tried, or lost.
    pub pending: usize,
    /// Done once, but with outputs gone; part of `pending`. Ascending.
    pub lost: Vec<i64>,
    /// Failed. Ascending.
    pub failed: Vec<i64>,
}

/// A job as it stands on disk.
#[derive(Debug, Clone)]
pub struct JobState {
    pub(crate) dir: PathBuf,
    pub(crate) plan: Plan,
    pub(crate) ledger: Ledger,
    pub(crate) states: BTreeMap<i64, FrameState>,
}

impl JobState {
    pub(crate) fn new(dir: &Path, plan: Plan, ledger: Ledger) -> Self {
        let states = look_at(dir, plan.frames(), &ledger);
        Self {
            dir: dir.to_owned(),
            plan,
            ledger,
            states,
        }
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

    /// How `frame` stands; None if it is not in the plan.
    pub fn frame_state(&self, frame: i64) -> Option<FrameState> {
        self.states.get(&frame).copied()
    }

    /// How all frames of the plan stand.
    pub fn summary(&self) -> Summary {
        self.summary_of(self.states.keys().copied())
    }

    /// How these frames stand; those not in the plan are left out.
    pub fn summary_of(&self, frames: impl IntoIterator<Item = i64>) -> Summary {
        let mut summary = Summary::default();
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

/// Threads that look at outputs: asking a network file system means waiting.
const LOOKERS: usize = 8;

/// Frames that are looked at by one thread alone.
const FEW: usize = 256;

/// Looks for the outputs of all frames.
fn look_at(dir: &Path, frames: &[PlannedFrame], ledger: &Ledger) -> BTreeMap<i64, FrameState> {
    let look = |some: &[PlannedFrame]| -> Vec<(i64, FrameState)> {
        let state = |f: &PlannedFrame| (f.number, frame_state(dir, f, ledger.entry(f.number)));
        some.iter().map(state).collect()
    };
    let each = frames.len().div_ceil(LOOKERS).max(FEW);
    thread::scope(|scope| {
        let lookers: Vec<_> = frames
            .chunks(each)
            .map(|some| scope.spawn(move || look(some)))
            .collect();
        let looked = lookers
            .into_iter()
            .map(|looker| looker.join().unwrap_or_else(|e| panic::resume_unwind(e)));
        looked.flatten().collect()
    })
}

/// What was made counts by what is wanted now: under other names the images are still to be made.
fn frame_state(dir: &Path, planned: &PlannedFrame, entry: Option<&Entry>) -> FrameState {
    let in_place = |file: &OutputFile| {
        fs::metadata(dir.join(&file.path)).is_ok_and(|m| m.is_file() && m.len() == file.len)
    };
    match entry {
        None => FrameState::Pending,
        Some(entry) if entry.status == Status::Failed => FrameState::Failed,
        Some(entry) => {
            let made = |path: &String| entry.outputs.iter().find(|o| o.path == *path);
            if planned
                .outputs
                .iter()
                .all(|p| made(p).is_some_and(in_place))
            {
                FrameState::Done
            } else {
                FrameState::Lost
            }
        }
    }
}
