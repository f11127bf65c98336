//! Makes plans from requests: new ones, and ones that extend an existing plan.

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;

use serde_json::Value;

use crate::copies::Copies;
use crate::fingerprint_cache::{FingerprintCache, frames_to_fingerprint};
use crate::input::{check_input, merged_input_dirs};
use crate::{
    FrameRequest, InputChange, JobError, JobRequest, JobState, Plan, PlannedFrame, PlannedInput,
    ResumeMode,
};

/// The plan of a new job.
pub(crate) fn new_plan(
    dir: &Path,
    request: &JobRequest,
    fingerprints: &mut FingerprintCache,
) -> Result<Plan, JobError> {
    let mut frames = planned_frames(fingerprints, dir, &request.frames)?;
    frames.sort_by_key(|f| f.number);
    let dirs = merged_input_dirs(&[], request);
    let settings = request.settings.clone();
    Ok(Plan::new(settings, Value::Null, dirs, frames))
}

/// The plan of a resumed job. Changed inputs of finished frames are refused or returned, depending on the mode
/// of the request.
pub(crate) fn merged_plan<E: Into<Box<dyn Error + Send + Sync>>>(
    state: &JobState,
    request: &JobRequest,
    selected: &[i64],
    fingerprints: &mut FingerprintCache,
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<ExtendedPlan, JobError> {
    // Refuse another input, and other settings unless they may change
    check_input(state, request, fingerprints)?;
    let dir = state.dir.clone();
    let changes = state.plan.changes_to(&request.settings);
    if request.mode != ResumeMode::KeepDone && !changes.is_empty() {
        return Err(JobError::SettingsChanged { dir, changes });
    }
    // Compare the inputs of planned frames with their files
    let mut frames = planned_frames(
        fingerprints,
        &dir,
        frames_to_fingerprint(request, selected, Some(&state.plan)),
    )?;
    let mut outdated = Vec::new();
    match request.mode {
        ResumeMode::Resume => {
            let changes = changed_inputs(state, &frames);
            if !changes.is_empty() {
                return Err(JobError::InputChanged { dir, changes });
            }
        }
        ResumeMode::RequeueChanged => {
            keep_unreadable_done(state, &mut frames);
            outdated = changed_inputs(state, &frames);
        }
        ResumeMode::Force | ResumeMode::KeepDone => {}
    }
    // Resolve automatic settings again only if others have changed
    let resolved = if changes.is_empty() {
        state.plan.resolved().clone()
    } else {
        resolve(Some(state.plan.resolved())).map_err(|e| JobError::Resolve(e.into()))?
    };
    let settings =
        if changes.is_empty() { state.plan.settings().to_vec() } else { request.settings.clone() };
    // Merge the frames into the plan
    let dirs = merged_input_dirs(state.plan.input_dirs(), request);
    let mut plan = Plan::new(settings, resolved, dirs, state.plan.frames().to_vec());
    plan.merge(frames);
    refuse_shared_outputs(&dir, &plan)?;
    Ok(ExtendedPlan { plan, changes: outdated })
}

/// Refuses two frames with the same output: a request may have other frames than the plan.
fn refuse_shared_outputs(dir: &Path, plan: &Plan) -> Result<(), JobError> {
    let mut owners = HashMap::new();
    for frame in plan.frames() {
        for output in &frame.outputs {
            if let Some(other) = owners.insert(output, frame.number) {
                return Err(JobError::PlannedOutput {
                    path: dir.join(output),
                    planned: other,
                    requested: frame.number,
                });
            }
        }
    }
    Ok(())
}

/// A plan with the new frames of a sequence.
pub(crate) struct ExtendedPlan {
    pub(crate) plan: Plan,
    /// Finished frames that must be repeated.
    pub(crate) changes: Vec<InputChange>,
}

/// The plan of an open job to which the frames `new` are added.
pub(crate) fn extended_plan(
    state: &JobState,
    request: &JobRequest,
    new: &[i64],
    fingerprints: &mut FingerprintCache,
) -> Result<ExtendedPlan, JobError> {
    let dir = state.dir.clone();
    let changes = state.plan.changes_to(&request.settings);
    if !changes.is_empty() {
        return Err(JobError::SettingsChanged { dir, changes });
    }
    let mut frames =
        planned_frames(fingerprints, &dir, frames_to_fingerprint(request, new, Some(&state.plan)))?;
    keep_unreadable_done(state, &mut frames);
    let changes = changed_inputs(state, &frames);
    let mut plan = state.plan.clone();
    plan.merge(frames);
    Ok(ExtendedPlan { plan, changes })
}

/// Removes finished frames that are no longer readable from `frames`, so that the plan keeps the old ones. An image
/// is not outdated because its input was deleted.
fn keep_unreadable_done(state: &JobState, frames: &mut Vec<PlannedFrame>) {
    let is_readable = |f: &PlannedFrame| f.inputs.iter().all(|i| i.fingerprint.is_some());
    frames.retain(|now| is_readable(now) || !state.is_done(now.number));
}

/// Finished frames whose inputs have changed. The other frames use the current inputs anyway.
fn changed_inputs(state: &JobState, frames: &[PlannedFrame]) -> Vec<InputChange> {
    let mut copies = Copies::default();
    let mut changes: Vec<InputChange> = frames
        .iter()
        .filter(|now| state.is_done(now.number))
        .filter_map(|now| {
            let (path, what) = state.plan.frame(now.number)?.changed_input(now, &mut copies)?;
            Some(InputChange { frame: now.number, path, what })
        })
        .collect();
    changes.sort_by_key(|c| c.frame);
    changes
}

/// Converts `frames` to frames of a plan in `dir`.
fn planned_frames<'a>(
    fingerprints: &mut FingerprintCache,
    dir: &Path,
    frames: impl IntoIterator<Item = &'a FrameRequest>,
) -> Result<Vec<PlannedFrame>, JobError> {
    let mut planned = Vec::new();
    for frame in frames {
        let mut inputs = Vec::with_capacity(frame.inputs.len());
        for path in frame.dependencies() {
            inputs.push(PlannedInput { path: utf8(path)?, fingerprint: fingerprints.get(path) });
        }
        let outputs = frame.outputs.iter().map(|path| stored_path(dir, path));
        planned.push(PlannedFrame {
            number: frame.number,
            inputs,
            outputs: outputs.collect::<Result<_, _>>()?,
        });
    }
    Ok(planned)
}

/// `path` relative to `dir` if possible, so that the directory can be moved.
pub(crate) fn stored_path(dir: &Path, path: &Path) -> Result<String, JobError> {
    let failed = |e| JobError::io(path, "resolving the path", e);
    let path = std::path::absolute(path).map_err(failed)?;
    let dir = std::path::absolute(dir).map_err(failed)?;
    utf8(path.strip_prefix(dir).unwrap_or(&path))
}

fn utf8(path: &Path) -> Result<String, JobError> {
    path.to_str().map(str::to_owned).ok_or_else(|| JobError::NotUtf8 { path: path.to_owned() })
}
