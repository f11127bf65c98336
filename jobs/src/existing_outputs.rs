//! Refuses to replace files that have the names of outputs but were not written by a worker of the job.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::ledger::{ledger_files, read_outputs};
use crate::{JobError, JobRequest, JobState, Plan};

impl JobRequest {
    /// Refuses to start a job whose outputs exist.
    ///
    /// # Errors
    /// [`JobError::OutputsExist`].
    pub(crate) fn refuse_existing_outputs(&self) -> Result<(), JobError> {
        let outputs =
            self.frames.iter().flat_map(|f| &f.outputs).chain(&self.extra_outputs).cloned();
        refuse(existing(outputs))
    }
}

impl JobState {
    /// Refuses outputs of the new `plan` that exist and were not in the old plan. Existing files of the old
    /// plan may come from a worker that was killed before it recorded them.
    ///
    /// # Errors
    /// [`JobError::OutputsExist`], or a ledger cannot be read.
    pub(crate) fn refuse_existing_outputs(&self, plan: &Plan) -> Result<(), JobError> {
        let mut new = Vec::new();
        for frame in plan.frames() {
            let known = self.plan.frame(frame.number);
            let is_known = |path: &String| known.is_some_and(|f| f.outputs.contains(path));
            new.extend(frame.outputs.iter().filter(|path| !is_known(path)));
        }
        let mut found = existing(new.into_iter().map(|path| self.dir.join(path)));
        if !found.is_empty() {
            // This job may have written them before its outputs were renamed
            let mut written = HashSet::new();
            for file in ledger_files(&self.dir)? {
                let outputs = read_outputs(&file.path)?;
                written.extend(outputs.into_iter().map(|path| self.dir.join(path)));
            }
            found.retain(|path| !written.contains(path));
        }
        refuse(found)
    }
}

fn refuse(paths: Vec<PathBuf>) -> Result<(), JobError> {
    if paths.is_empty() { Ok(()) } else { Err(JobError::OutputsExist { paths }) }
}

/// The existing ones of `paths`. Lists directories first, because a query per file is slow on network file
/// systems.
fn existing(paths: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
    let mut by_dir: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for path in paths {
        let dir = path.parent().unwrap_or(Path::new("")).to_owned();
        by_dir.entry(dir).or_default().push(path);
    }
    let mut found = Vec::new();
    for (dir, paths) in by_dir {
        let names = names_in(&dir);
        let may_exist = |path: &&PathBuf| match &names {
            Ok(names) => names.contains(&lowercase_name(path)),
            Err(e) => e.kind() != io::ErrorKind::NotFound,
        };
        let exists = |path: &&PathBuf| fs::symlink_metadata(path).is_ok();
        found.extend(paths.iter().filter(may_exist).filter(exists).cloned());
    }
    found
}

fn names_in(dir: &Path) -> io::Result<HashSet<String>> {
    let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
    let entries = fs::read_dir(dir)?;
    entries.map(|entry| Ok(lowercase_name(&entry?.path()))).collect()
}

/// Some file systems ignore case.
fn lowercase_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().to_lowercase()
}
