//! Checks that a request has the same input as the job. Frames of two simulations with one camera and one
//! colour range would look like one simulation.
//!
//! The input is the same if at least one given file has the directory and name of a file in the plan. Data may
//! be moved, and other machines may mount them elsewhere. In that case the same frames must have the same
//! contents.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use crate::fingerprint_cache::FingerprintCache;
use crate::{FrameRequest, JobError, JobRequest, JobState, PlannedFrame, PlannedInput, ResumeMode};

/// Number of frames whose contents are compared, spread over the sequence.
const MAX_COMPARED: usize = 32;

/// Number of input directories that a plan stores. There are several if a job runs on several machines or its
/// data were moved.
const MAX_DIRS: usize = 16;

/// Refuses a request with another input than that of the job.
///
/// # Errors
/// [`JobError::OtherInput`], or a path cannot be resolved.
pub(crate) fn check_input(
    state: &JobState,
    request: &JobRequest,
    fingerprints: &mut FingerprintCache,
) -> Result<(), JobError> {
    // Without files before or now, there is nothing to compare
    let planned = state.plan.frames().iter().flat_map(|f| &f.inputs);
    let mut given = request.frames.iter().flat_map(|f| &f.inputs);
    let (Some(old), Some(new)) = (planned.clone().next(), given.clone().next()) else {
        return Ok(());
    };
    // Files of known names in known directories belong to the same input
    let mut dirs = DirCache::default();
    let known_dirs: HashSet<PathBuf> = match state.plan.input_dirs() {
        [] => planned.clone().map(|i| dirs.get(Path::new(&i.path))).collect(),
        known => known.iter().map(PathBuf::from).collect(),
    };
    let names: HashSet<_> = planned.map(|i| Path::new(&i.path).file_name()).collect();
    let mut is_same_dir = false;
    let is_known = given.any(|path| {
        let is_in_known_dir = known_dirs.contains(&dirs.get(path));
        is_same_dir |= is_in_known_dir;
        is_in_known_dir && names.contains(&path.file_name())
    });
    // So do other files of these directories if done frames are kept, and copies elsewhere
    let is_kept = request.mode == ResumeMode::KeepDone && is_same_dir;
    if is_known || is_kept || has_same_contents(state, request, fingerprints) {
        return Ok(());
    }
    Err(JobError::OtherInput {
        dir: state.dir.clone(),
        planned: with_dir(old, &known_dirs),
        given: new.clone(),
        is_same_dir,
    })
}

/// A file of the plan with its directory, if that is unambiguous.
fn with_dir(input: &PlannedInput, dirs: &HashSet<PathBuf>) -> PathBuf {
    let path = PathBuf::from(&input.path);
    match (dirs.len(), dirs.iter().next(), path.file_name()) {
        (1, Some(dir), Some(name)) => dir.join(name),
        _ => path,
    }
}

/// Whether more than half of the comparable frames have files with the same contents. One frame is not enough:
/// the first frames of two simulations are often equal, and the last frame may have been incomplete.
fn has_same_contents(
    state: &JobState,
    request: &JobRequest,
    fingerprints: &mut FingerprintCache,
) -> bool {
    let shared: Vec<(&PlannedFrame, &FrameRequest)> = request
        .frames
        .iter()
        .filter_map(|f| Some((state.plan.frame(f.number)?, f)))
        .filter(|(old, _)| old.inputs.iter().all(|i| i.fingerprint.is_some()))
        .collect();
    // Prefer finished frames: the inputs of the others may have changed since they were planned
    let (done, pending): (Vec<_>, Vec<_>) =
        shared.into_iter().partition(|(old, _)| state.is_done(old.number));
    let comparable = if done.is_empty() { pending } else { done };
    let step = comparable.len().div_ceil(MAX_COMPARED).max(1);
    let compared: Vec<bool> = comparable
        .iter()
        .step_by(step)
        .map(|(old, new)| is_same_frame(&old.inputs, new, fingerprints))
        .collect();
    2 * compared.iter().filter(|same| **same).count() > compared.len()
}

fn is_same_frame(
    old: &[PlannedInput],
    new: &FrameRequest,
    fingerprints: &mut FingerprintCache,
) -> bool {
    let mut pairs = old.iter().zip(new.dependencies());
    old.len() == new.dependencies().count()
        && pairs.all(|(old, new)| match (&old.fingerprint, fingerprints.get(new)) {
            (Some(old), Some(new)) => old.has_same_contents(&new),
            _ => false,
        })
}

/// The input directories of a plan after `request`, given the `old` ones.
pub(crate) fn merged_input_dirs(old: &[String], request: &JobRequest) -> Vec<String> {
    let mut dirs = DirCache::default();
    let inputs = request.frames.iter().flat_map(|f| &f.inputs);
    let found: BTreeSet<PathBuf> = inputs.map(|path| dirs.get(path)).collect();
    let given = found.iter().filter_map(|dir| dir.to_str()).take(MAX_DIRS);
    let mut all = old.to_vec();
    for dir in given {
        if !old.iter().any(|known| known == dir) {
            all.push(dir.to_owned());
        }
    }
    all.split_off(all.len().saturating_sub(MAX_DIRS))
}

/// Directories of files, absolute and without links. Each is resolved once.
#[derive(Default)]
struct DirCache {
    known: HashMap<PathBuf, PathBuf>,
}

impl DirCache {
    fn get(&mut self, file: &Path) -> PathBuf {
        let dir = match file.parent() {
            Some(dir) if !dir.as_os_str().is_empty() => dir,
            _ => Path::new("."),
        };
        if let Some(known) = self.known.get(dir) {
            return known.clone();
        }
        let real = dir
            .canonicalize()
            .or_else(|_| std::path::absolute(dir))
            .unwrap_or_else(|_| dir.to_owned());
        self.known.insert(dir.to_owned(), real.clone());
        real
    }
}
