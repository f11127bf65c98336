//! The frames that the runs of a job have asked for, among all frames of its plan.

use std::path::Path;

use spherule_jobs::{FrameRange, FrameState, JobState};

use super::manifest_file::JOB_FILE;
use crate::manifest::{Manifest, read_manifest};

/// The frames that the last `render` asked for, and all that are finished or failed, ascending: a job of `--frames
/// 1-200x10` is complete after twenty frames. All frames of the plan if the job has no manifest beside its images, or
/// if that selects all.
pub fn requested_frames(state: &JobState) -> Vec<i64> {
    let numbers: Vec<i64> = state.plan().frames().iter().map(|f| f.number).collect();
    let Some(range) = requested_range(state.dir()) else {
        return numbers;
    };
    let is_pending = |frame: &i64| state.frame_state(*frame) == Some(FrameState::Pending);
    let is_requested = |frame: &i64| range.contains(*frame) || !is_pending(frame);
    numbers.into_iter().filter(is_requested).collect()
}

/// The range in the manifest that the job has written beside its images.
fn requested_range(dir: &Path) -> Option<FrameRange> {
    let path = dir.join(JOB_FILE);
    let text = read_manifest(&path).ok()?;
    Manifest::parse(&text, &path).ok()?.input.frames
}
