//! Plans as they come of requests: of nothing, or of the plan that is there.

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;

use serde_json::Value;

use crate::fingerprint_cache::{FingerprintCache, wanted};
use crate::input::{check_input, input_dirs};
use crate::{
    FrameRequest, InputChange, JobError, JobRequest, JobState, Mode, Plan, PlannedFrame,
    PlannedInput,
};

/// The plan of a job that begins.
pub(crate) fn new_plan(
    dir: &Path,
    request: &JobRequest,
    prints: &mut FingerprintCache,
) -> Result<Plan, JobError> {
    let mut frames = planned_frames(prints, dir, &request.frames)?;
    frames.sort_by_key(|f| f.number);
    let dirs = input_dirs(&[], request);
    let settings = request.settings.clone();
    Ok(Plan::new(settings, Value::Null, dirs, frames))
}

/// The plan of a job that goes on. Changed inputs of finished frames are refused, or reported, as the
/// request's mode says.
pub(crate) fn merged_plan<E: Into<Box<dyn Error + Send + Sync>>>(
    state: &JobState,
    request: &JobRequest,
    selected: &[i64],
    prints: &mut FingerprintCache,
    resolve: impl FnOnce(Option<&Value>) -> Result<Value, E>,
) -> Result<Extension, JobError> {
    check_input(state, request, prints)?;
    let dir = state.dir.clone();
    let changes = state.plan.changes_to(&request.settings);
    if request.mode != Mode::KeepDone && !changes.is_empty() {
        return Err(JobError::SettingsChanged { dir, changes });
    }
    let mut frames = planned_frames(prints, &dir, wanted(request, selected, Some(&state.plan)))?;
    let mut stale = Vec::new();
    match request.mode {
        Mode::Resume => {
            let changes = changed_inputs(state, &frames);
            if !changes.is_empty() {
                return Err(JobError::InputChanged { dir, changes });
            }
        }
        Mode::RequeueChanged => {
            keep_cleared_away(state, &mut frames);
            stale = changed_inputs(state, &frames);
        }
        Mode::Force | Mode::KeepDone => {}
    }
    let resolved = if changes.is_empty() {
        state.plan.resolved().clone()
    } else {
        resolve(Some(state.plan.resolved())).map_err(|e| JobError::Resolve(e.into()))?
    };
    let settings = if changes.is_empty() {
        state.plan.settings().to_vec()
    } else {
        request.settings.clone()
    };
    let dirs = input_dirs(state.plan.input_dirs(), request);
    let mut plan = Plan::new(settings, resolved, dirs, state.plan.frames().to_vec());
    plan.merge(frames);
    refuse_shared_outputs(&dir, &plan)?;
    Ok(Extension {
        plan,
        changes: stale,
    })
}

/// A request may have other frames than the plan, under a name that one of the plan's has.
fn refuse_shared_outputs(dir: &Path, plan: &Plan) -> Result<(), JobError> {
    let mut owners = HashMap::new();
    for frame in plan.frames() {
        for output in &frame.outputs {
            if let Some(other) = owners.insert(output, frame.number) {
                return Err(JobError::Request(format!(
                    "{}: the job has frame {other} and would have frame {} under this name; put #### into \
                     the name, choose another one, or start over with --force",
                    dir.join(output).display(),
                    frame.number
                )));
            }
        }
    }
    Ok(())
}

/// What comes of a sequence that may have grown.
pub(crate) struct Extension {
    pub(crate) plan: Plan,
    /// Finished frames that are to be made anew.
    pub(crate) changes: Vec<InputChange>,
}

/// The plan of a job that takes in the frames `new` while it is open.
pub(crate) fn extended_plan(
    state: &JobState,
    request: &JobRequest,
    new: &[i64],
    prints: &mut FingerprintCache,
) -> Result<Extension, JobError> {
    let dir = state.dir.clone();
    let changes = state.plan.changes_to(&request.settings);
    if !changes.is_empty() {
        return Err(JobError::SettingsChanged { dir, changes });
    }
    let mut frames = planned_frames(prints, &dir, wanted(request, new, Some(&state.plan)))?;
    keep_cleared_away(state, &mut frames);
    let changes = changed_inputs(state, &frames);
    let mut plan = state.plan.clone();
    plan.merge(frames);
    Ok(Extension { plan, changes })
}

/// Leaves finished frames that cannot be read any more out of `frames`, so that the plan keeps them as they were: an
/// image is not stale because its input has been cleared away since.
fn keep_cleared_away(state: &JobState, frames: &mut Vec<PlannedFrame>) {
    let is_readable = |f: &PlannedFrame| f.inputs.iter().all(|i| i.fingerprint.is_some());
    frames.retain(|now| is_readable(now) || !state.is_done(now.number));
}

/// Only finished frames can be stale; the others will be made from what is there now.
fn changed_inputs(state: &JobState, frames: &[PlannedFrame]) -> Vec<InputChange> {
    let mut changes: Vec<InputChange> = frames
        .iter()
        .filter(|now| state.is_done(now.number))
        .filter_map(|now| {
            let (path, what) = state.plan.frame(now.number)?.changed_input(now)?;
            Some(InputChange {
                frame: now.number,
                path,
                what,
            })
        })
        .collect();
    changes.sort_by_key(|c| c.frame);
    changes
}

/// `frames` as a plan in `dir` lists them.
fn planned_frames<'a>(
    fingerprints: &mut FingerprintCache,
    dir: &Path,
    frames: impl IntoIterator<Item = &'a FrameRequest>,
) -> Result<Vec<PlannedFrame>, JobError> {
    let mut planned = Vec::new();
    for frame in frames {
        let mut inputs = Vec::with_capacity(frame.inputs.len());
        for path in &frame.inputs {
            inputs.push(PlannedInput {
                path: utf8(path)?,
                fingerprint: fingerprints.of(path),
            });
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

/// Relative to `dir` where it can be, so that the directory may be moved.
pub(crate) fn stored_path(dir: &Path, path: &Path) -> Result<String, JobError> {
    let failed = |e| JobError::io(path, "finding its absolute path", e);
    let path = std::path::absolute(path).map_err(failed)?;
    let dir = std::path::absolute(dir).map_err(failed)?;
    utf8(path.strip_prefix(dir).unwrap_or(&path))
}

fn utf8(path: &Path) -> Result<String, JobError> {
    path.to_str().map(str::to_owned).ok_or_else(|| {
        JobError::Request(format!(
            "{}: the name is not UTF-8 and cannot go into a plan; rename it",
            path.display()
        ))
    })
}
