//! Files under the names of outputs that no worker of the job has made: they are somebody's, and are not
//! replaced without being asked for.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::ledger::{ledger_files, outputs_of};
use crate::{JobError, JobRequest, JobState, Plan};

/// Refuses to begin a job whose files would replace others.
///
/// # Errors
/// [`JobError::OutputsExist`].
pub(crate) fn refuse_at_begin(request: &JobRequest) -> Result<(), JobError> {
    let outputs = request.frames.iter().flat_map(|f| &f.outputs);
    let outputs = outputs.chain(&request.extra_outputs).cloned();
    refuse(existing(outputs))
}

/// Refuses outputs of `plan` that the job in `old` did not have yet and that are there. Those that it had may
/// have been made by a worker that was killed before it could say so.
///
/// # Errors
/// [`JobError::OutputsExist`], or a ledger cannot be read.
pub(crate) fn refuse_new(old: &JobState, plan: &Plan) -> Result<(), JobError> {
    let mut new = Vec::new();
    for frame in plan.frames() {
        let known = old.plan.frame(frame.number);
        let is_known = |path: &String| known.is_some_and(|f| f.outputs.contains(path));
        new.extend(frame.outputs.iter().filter(|path| !is_known(path)));
    }
    let mut found = existing(new.into_iter().map(|path| old.dir.join(path)));
    if !found.is_empty() {
        // They may have been this job's before its outputs got other names.
        let mut made = HashSet::new();
        for file in ledger_files(&old.dir)? {
            let outputs = outputs_of(&file.path)?;
            made.extend(outputs.into_iter().map(|path| old.dir.join(path)));
        }
        found.retain(|path| !made.contains(path));
    }
    refuse(found)
}

fn refuse(paths: Vec<PathBuf>) -> Result<(), JobError> {
    if paths.is_empty() {
        Ok(())
    } else {
        Err(JobError::OutputsExist { paths })
    }
}

/// Those of `paths` that are there. Directories are listed, for asking a network file system for each of many
/// files takes long.
fn existing(paths: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
    let mut by_dir: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for path in paths {
        let dir = path.parent().unwrap_or(Path::new("")).to_owned();
        by_dir.entry(dir).or_default().push(path);
    }
    let mut found = Vec::new();
    for (dir, paths) in by_dir {
        let names = names_in(&dir);
        let may_be = |path: &&PathBuf| match &names {
            Ok(names) => names.contains(&lower_name(path)),
            Err(e) => e.kind() != io::ErrorKind::NotFound,
        };
        let is_there = |path: &&PathBuf| fs::symlink_metadata(path).is_ok();
        found.extend(paths.iter().filter(may_be).filter(is_there).cloned());
    }
    found
}

fn names_in(dir: &Path) -> io::Result<HashSet<String>> {
    let dir = if dir.as_os_str().is_empty() {
        Path::new(".")
    } else {
        dir
    };
    let entries = fs::read_dir(dir)?;
    entries
        .map(|entry| Ok(lower_name(&entry?.path())))
        .collect()
}

/// Some file systems do not tell case apart.
fn lower_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().to_lowercase()
}
