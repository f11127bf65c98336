//! The current state of a job, from its ledger: `report.json` for scripts and `report.html` for people, both from one
//! [`JobReport`].

#[cfg(feature = "pages")]
mod frames;
#[cfg(feature = "pages")]
mod html;
mod json;
#[cfg(feature = "pages")]
mod numbers;
#[cfg(feature = "pages")]
mod plots;
#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::io;
use std::path::Path;

use serde_json::Value;
use spherule_jobs::{FrameState, JobState, LedgerEntry, PlannedFrame, publish, read_regular_text};
use spherule_tree::accel::simd::SimdLevel;

use super::frame::FrameReport;

/// Name of the report for scripts, next to the images.
pub const JSON_FILE: &str = "report.json";
/// Name of the report for people.
pub const HTML_FILE: &str = "report.html";

/// Number of frames in the list of the slowest ones.
const SLOWEST: usize = 10;

/// The current state of a job.
#[derive(Debug, Clone)]
pub struct JobReport {
    /// Sorted by number.
    frames: Vec<JobFrame>,
    /// Sums over the finished frames; for memory, the largest value.
    totals: FrameReport,
    /// Keys and values.
    settings: Vec<(String, String)>,
    machine: Machine,
}

/// A planned frame, with its ledger entry.
#[derive(Debug, Clone)]
struct JobFrame {
    number: i64,
    image: Option<String>,
    status: Status,
    /// The reason of its failure.
    reason: Option<String>,
    /// The details of the ledger entry.
    details: Value,
    /// The parsed details; None unless finished.
    report: Option<FrameReport>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Status {
    Done,
    Failed,
    Pending,
}

/// The machine that writes the report, which may differ from the machines that rendered the frames.
#[derive(Debug, Clone)]
struct Machine {
    threads: usize,
    simd: &'static str,
}

impl Machine {
    fn this() -> Self {
        Self { threads: rayon::current_num_threads(), simd: SimdLevel::best().name() }
    }
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
    /// A report from plan, ledger and disk, with the `settings` of this run.
    pub fn new(state: &JobState, settings: Vec<(String, String)>) -> Self {
        let frames =
            state.plan().frames().iter().map(|planned| JobFrame::new(state, planned)).collect();
        Self::of(frames, settings, Machine::this())
    }

    /// A report whose settings are those of the plan.
    pub fn of_plan(state: &JobState) -> Self {
        Self::new(state, state.plan().settings().to_vec())
    }

    fn of(frames: Vec<JobFrame>, settings: Vec<(String, String)>, machine: Machine) -> Self {
        let mut totals = FrameReport::default();
        for report in frames.iter().filter_map(|frame| frame.report.as_ref()) {
            totals.add(report);
        }
        Self { frames, totals, settings, machine }
    }

    /// Names and contents of the report files. The page needs the feature `pages`.
    pub fn files(&self) -> Vec<(&'static str, String)> {
        vec![
            (JSON_FILE, format!("{:#}\n", self.to_json())),
            #[cfg(feature = "pages")]
            (HTML_FILE, self.to_html()),
        ]
    }

    /// Numbers of the frames with `status`.
    fn with_status(&self, status: Status) -> Vec<i64> {
        let frames = self.frames.iter().filter(|frame| frame.status == status);
        frames.map(|frame| frame.number).collect()
    }

    /// The finished frames with their reports.
    fn done(&self) -> impl Iterator<Item = (&JobFrame, &FrameReport)> {
        let frames = self.frames.iter();
        frames.filter_map(|frame| Some((frame, frame.report.as_ref()?)))
    }

    /// The slowest frames, slowest first.
    fn slowest(&self) -> Vec<(&JobFrame, &FrameReport)> {
        let mut frames: Vec<_> = self.done().collect();
        frames.sort_by_key(|(frame, report)| (Reverse(report.total()), frame.number));
        frames.truncate(SLOWEST);
        frames
    }
}

impl JobFrame {
    fn new(state: &JobState, planned: &PlannedFrame) -> Self {
        // A lost image must be rendered again, so its ledger entry is ignored.
        let status = match state.frame_state(planned.number) {
            Some(FrameState::Done) => Status::Done,
            Some(FrameState::Failed) => Status::Failed,
            Some(FrameState::Pending | FrameState::Lost) | None => Status::Pending,
        };
        let entry = state.ledger().entry(planned.number).filter(|_| status != Status::Pending);
        Self::of(planned.number, planned.outputs.first().cloned(), status, entry)
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

/// Publishes one of [`JobReport::files`] in `dir`, unless the file is already up to date.
///
/// # Errors
/// The file cannot be written.
pub fn write(dir: &Path, name: &str, text: &str) -> io::Result<()> {
    let path = dir.join(name);
    if read_regular_text(&path, text.len() as u64).is_ok_and(|old| old == text) {
        return Ok(());
    }
    publish(&path, text.as_bytes())
}
