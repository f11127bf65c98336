//! The output directory of a job: whether it may be used, and what an earlier run stored in its plan.

use std::path::Path;

use serde_json::Value;
use spherule_jobs::{Job, PLAN_FILE, ResumeMode};

use super::RunError;
use crate::survey::Survey;

/// The setting that stores the kind of a job in its plan. Jobs that render do not have it.
pub const KIND: &str = "job";

/// Refuses an output directory whose path leads to a file, or that contains a job of another kind. `purpose` is what
/// the directory is for. `kind` is the value of [`KIND`], if any.
pub(super) fn check_output_dir(
    dir: &Path,
    purpose: &'static str,
    kind: Option<&str>,
    mode: ResumeMode,
) -> Result<(), RunError> {
    // Refuse a path that leads to a file
    if let Some(path) = dir.ancestors().find(|p| p.exists())
        && !path.is_dir()
    {
        let path = path.to_owned();
        return Err(RunError::OutputIsFile { path, purpose });
    }
    // Refuse a job of another kind, unless it is to be overwritten
    if mode == ResumeMode::Force {
        return Ok(());
    }
    let Some(plan) = Job::read_plan(dir)? else {
        return Ok(());
    };
    let mut settings = plan.settings().iter();
    let found = settings.find(|(key, _)| key == KIND).map(|(_, v)| &v[..]);
    if found == kind {
        return Ok(());
    }
    let command = |kind: Option<&str>| kind.unwrap_or("render").to_owned();
    Err(RunError::OtherKind { dir: dir.to_owned(), found: command(found), expected: command(kind) })
}

/// The survey that is stored in the plan of the job in `dir`.
pub(super) fn stored_survey(resolved: &Value, dir: &Path) -> Result<Survey, RunError> {
    serde_json::from_value(resolved.clone())
        .map_err(|source| RunError::StoredSurvey { path: dir.join(PLAN_FILE), source })
}
