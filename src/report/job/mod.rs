//! A job so far, from its ledger: `report.json` for scripts, `report.html` for people, both from
//! one [`JobReport`].

mod frames;
mod html;
mod json;
mod numbers;
mod plots;
#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::io;
use std::path::Path;

use serde_json::Value;
use spherule_jobs::{FrameState, JobState, LedgerEntry, PlannedFrame, publish, read_regular_text};

use super::frame::FrameReport;
use crate::accel::simd::SimdLevel;
use crate::manifest::Manifest;

/// Name of the report for scripts, beside the images.
pub const JSON_FILE: &str = "report.json";
/// Name of the report for people.
pub const HTML_FILE: &str = "report.html";

/// How many frames count as the slowest.
const SLOWEST: usize = 10;

/// A job so far.
#[derive(Debug, Clone)]
pub struct JobReport {
    /// By number.
    frames: Vec<JobFrame>,
    /// Sums over the frames that are done, of memory the largest value.
    totals: FrameReport,
    /// Keys and values as the manifest has them.
    settings: Vec<(String, String)>,
    machine: Machine,
}

/// A frame of the plan and the ledger's word on it.
#[derive(Debug, Clone)]
struct JobFrame {
    number: i64,
    image: Option<String>,
    status: Status,
    /// Why it failed.
    reason: Option<String>,
    /// As the ledger has it.
    details: Value,
    /// The same read; None unless done.
    report: Option<FrameReport>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Status {
    Done,
    Failed,
    Pending,
}

/// What the report was written on, which is not always what the frames were made on.
#[derive(Debug, Clone)]
struct Machine {
    threads: usize,
    simd: &'static str,
}

impl Status {
    const fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Pending => "pending",
        }
    }
}

impl JobReport {
    /// What plan, ledger and disk say.
    pub fn new(state: &JobState, manifest: &Manifest) -> Self {
        let frames = state.plan().frames().iter();
        let frames = frames
            .map(|planned| JobFrame::new(state, planned))
            .collect();
        let machine = Machine {
            threads: rayon::current_num_threads(),
            simd: SimdLevel::best().name(),
        };
        Self::of(frames, manifest.settings(), machine)
    }

    fn of(frames: Vec<JobFrame>, settings: Vec<(String, String)>, machine: Machine) -> Self {
        let mut totals = FrameReport::default();
        for report in frames.iter().filter_map(|frame| frame.report.as_ref()) {
            totals.add(report);
        }
        Self {
            frames,
            totals,
            settings,
            machine,
        }
    }

    /// Names and contents of the files that tell of it.
    pub fn files(&self) -> [(&'static str, String); 2] {
        let json = format!("{:#}\n", self.to_json());
        [(JSON_FILE, json), (HTML_FILE, self.to_html())]
    }

    /// Numbers of the frames that stand so.
    fn with_status(&self, status: Status) -> Vec<i64> {
        let frames = self.frames.iter().filter(|frame| frame.status == status);
        frames.map(|frame| frame.number).collect()
    }

    /// Frames that are done, with what they took.
    fn done(&self) -> impl Iterator<Item = (&JobFrame, &FrameReport)> {
        let frames = self.frames.iter();
        frames.filter_map(|frame| Some((frame, frame.report.as_ref()?)))
    }

    /// The frames that took longest, the longest first.
    fn slowest(&self) -> Vec<(&JobFrame, &FrameReport)> {
        let mut frames: Vec<_> = self.done().collect();
        frames.sort_by_key(|(frame, report)| (Reverse(report.total()), frame.number));
        frames.truncate(SLOWEST);
        frames
    }
}

impl JobFrame {
    fn new(state: &JobState, planned: &PlannedFrame) -> Self {
        // A lost image is still to be made, and what the ledger says of it does not hold.
        let status = match state.frame_state(planned.number) {
            Some(FrameState::Done) => Status::Done,
            Some(FrameState::Failed) => Status::Failed,
            Some(FrameState::Pending | FrameState::Lost) | None => Status::Pending,
        };
        let entry = state.ledger().entry(planned.number);
        let entry = entry.filter(|_| status != Status::Pending);
        Self::of(
            planned.number,
            planned.outputs.first().cloned(),
            status,
            entry,
        )
    }

    fn of(number: i64, image: Option<String>, status: Status, entry: Option<&LedgerEntry>) -> Self {
        let details = entry.map_or(Value::Null, |entry| entry.details.value());
        let report = serde_json::from_value(details.clone()).ok();
        Self {
            number,
            image,
            status,
            reason: entry.and_then(|entry| entry.reason.clone()),
            details,
            report: report.filter(|_| status == Status::Done),
        }
    }
}

/// Publishes one of [`JobReport::files`] in `dir`, unless it stands there already.
///
/// # Errors
/// It cannot be written.
pub fn write(dir: &Path, name: &str, text: &str) -> io::Result<()> {
    let path = dir.join(name);
    if read_regular_text(&path, text.len() as u64).is_ok_and(|old| old == text) {
        return Ok(());
    }
    publish(&path, text.as_bytes())
}
