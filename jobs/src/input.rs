//! Whether a request is about the input that a job was begun with: frames of two simulations under one
//! camera and one colour range would look like one.
//!
//! It is, if a file that the plan knows is among those given now, by directory and name. Data may be moved,
//! and other machines may see them elsewhere; then the same frames must have the same contents.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use crate::fingerprint_cache::FingerprintCache;
use crate::{JobError, JobRequest, JobState, Mode, PlannedFrame, PlannedInput};

/// Frames whose contents are compared, spread over the sequence.
const SAMPLES: usize = 32;

/// Directories that a plan keeps: those of a job on several machines, or that was moved.
const MAX_DIRS: usize = 16;

/// Refuses a request that is about another input than the job in `state`.
///
/// # Errors
/// [`JobError::OtherInput`], or a path cannot be resolved.
pub(crate) fn check_input(
    state: &JobState,
    request: &JobRequest,
    prints: &mut FingerprintCache,
) -> Result<(), JobError> {
    let planned = state.plan.frames().iter().flat_map(|f| &f.inputs);
    let mut given = request.frames.iter().flat_map(|f| &f.inputs);
    let (Some(old), Some(new)) = (planned.clone().next(), given.clone().next()) else {
        return Ok(());
    };
    let mut dirs = Dirs::default();
    let known_dirs: HashSet<PathBuf> = match state.plan.input_dirs() {
        [] => planned
            .clone()
            .map(|i| dirs.of(Path::new(&i.path)))
            .collect(),
        known => known.iter().map(PathBuf::from).collect(),
    };
    let names: HashSet<_> = planned.map(|i| Path::new(&i.path).file_name()).collect();
    let mut is_same_dir = false;
    let is_known = given.any(|path| {
        let is_in_known_dir = known_dirs.contains(&dirs.of(path));
        is_same_dir |= is_in_known_dir;
        is_in_known_dir && names.contains(&path.file_name())
    });
    let is_kept = request.mode == Mode::KeepDone && is_same_dir;
    if is_known || is_kept || has_same_contents(state, request, prints) {
        return Ok(());
    }
    Err(JobError::OtherInput {
        dir: state.dir.clone(),
        planned: shown(old, &known_dirs),
        given: new.clone(),
        is_same_dir,
    })
}

/// A file of the plan with its directory, if that is clear.
fn shown(input: &PlannedInput, dirs: &HashSet<PathBuf>) -> PathBuf {
    let path = PathBuf::from(&input.path);
    match (dirs.len(), dirs.iter().next(), path.file_name()) {
        (1, Some(dir), Some(name)) => dir.join(name),
        _ => path,
    }
}

/// Whether more than half of the frames that can be compared were made from files of the same contents. The
/// first frames of two simulations often are the same; the last frame of one may have been completed since.
fn has_same_contents(
    state: &JobState,
    request: &JobRequest,
    prints: &mut FingerprintCache,
) -> bool {
    let shared: Vec<(&PlannedFrame, &[PathBuf])> = request
        .frames
        .iter()
        .filter_map(|f| Some((state.plan.frame(f.number)?, &f.inputs[..])))
        .filter(|(old, _)| old.inputs.iter().all(|i| i.fingerprint.is_some()))
        .collect();
    // What is not finished may have changed since it was planned.
    let (done, open): (Vec<_>, Vec<_>) = shared
        .into_iter()
        .partition(|(old, _)| state.is_done(old.number));
    let comparable = if done.is_empty() { open } else { done };
    let step = comparable.len().div_ceil(SAMPLES).max(1);
    let compared: Vec<bool> = comparable
        .iter()
        .step_by(step)
        .map(|(old, new)| is_same_frame(&old.inputs, new, prints))
        .collect();
    2 * compared.iter().filter(|same| **same).count() > compared.len()
}

fn is_same_frame(old: &[PlannedInput], new: &[PathBuf], prints: &mut FingerprintCache) -> bool {
    let mut pairs = old.iter().zip(new);
    old.len() == new.len()
        && pairs.all(|(old, new)| match (&old.fingerprint, prints.of(new)) {
            (Some(old), Some(new)) => old.has_contents_of(&new),
            _ => false,
        })
}

/// The directories of a plan that knew `old` ones when `request` goes on with it.
pub(crate) fn input_dirs(old: &[String], request: &JobRequest) -> Vec<String> {
    let mut dirs = Dirs::default();
    let inputs = request.frames.iter().flat_map(|f| &f.inputs);
    let given: BTreeSet<PathBuf> = inputs.map(|path| dirs.of(path)).collect();
    let given = given.iter().filter_map(|dir| dir.to_str()).take(MAX_DIRS);
    let mut all = old.to_vec();
    for dir in given {
        if !old.iter().any(|known| known == dir) {
            all.push(dir.to_owned());
        }
    }
    all.split_off(all.len().saturating_sub(MAX_DIRS))
}

/// Directories of files, absolute and without links, each asked for once.
#[derive(Default)]
struct Dirs {
    known: HashMap<PathBuf, PathBuf>,
}

impl Dirs {
    fn of(&mut self, file: &Path) -> PathBuf {
        let dir = match file.parent() {
            Some(dir) if !dir.as_os_str().is_empty() => dir,
            _ => Path::new("."),
        };
        if let Some(known) = self.known.get(dir) {
            return known.clone();
        }
        let real = dir.canonicalize().or_else(|_| std::path::absolute(dir));
        let real = real.unwrap_or_else(|_| dir.to_owned());
        self.known.insert(dir.to_owned(), real.clone());
        real
    }
}
