//! Creates names exclusively, lists worker records, and removes stale files.

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::{RECORD_SUFFIX, WorkerRecord};
use crate::publish::part_owner;

/// Links the file `record_path` to the new name `to`. Returns false if `to` exists. On file systems without
/// hard links a file with the same `text` is created instead.
pub(super) fn link_exclusively(record_path: &Path, to: &Path, text: &[u8]) -> io::Result<bool> {
    use io::ErrorKind as Kind;
    match fs::hard_link(record_path, to) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == Kind::AlreadyExists => Ok(false),
        Err(e)
            if matches!(
                e.kind(),
                Kind::Unsupported | Kind::PermissionDenied | Kind::TooManyLinks
            ) =>
        {
            create_exclusively(to, text)
        }
        Err(e) => Err(e),
    }
}

/// Creates a file. Returns false if the name exists.
pub(super) fn create_exclusively(to: &Path, text: &[u8]) -> io::Result<bool> {
    match OpenOptions::new().write(true).create_new(true).open(to) {
        Ok(mut file) => file.write_all(text).map(|()| true).inspect_err(|_| {
            let _ = fs::remove_file(to);
        }),
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(e) => Err(e),
    }
}

/// Removes a file. It is not an error if the file does not exist.
pub(super) fn remove_if_exists(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// All paths in the directory `work_dir`; empty if it does not exist.
pub(super) fn list_files(work_dir: &Path) -> io::Result<Vec<PathBuf>> {
    match fs::read_dir(work_dir) {
        Ok(entries) => entries.map(|entry| Ok(entry?.path())).collect(),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(e) => Err(e),
    }
}

/// The worker records in the directory `work_dir`; None for those that cannot be read.
pub(super) fn list_records(work_dir: &Path) -> io::Result<Vec<(PathBuf, Option<WorkerRecord>)>> {
    let is_record = |path: &PathBuf| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().ends_with(RECORD_SUFFIX))
    };
    let paths = list_files(work_dir)?.into_iter().filter(is_record);
    let mut records = Vec::new();
    for path in paths {
        match WorkerRecord::read(&path) {
            Ok(record) => {
                let record = record.filter(|record| record.is_at(&path));
                records.push((path, record));
            }
            // The worker has just ended
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(_) => records.push((path, None)),
        }
    }
    Ok(records)
}

/// Removes the temporary files in `dir` whose owner is not in `living_owners`; returns their count.
pub(crate) fn remove_stale_parts(dir: &Path, living_owners: &HashSet<String>) -> io::Result<usize> {
    let mut removed = 0;
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some(owner) = name.to_str().and_then(part_owner) else {
            continue;
        };
        if living_owners.contains(owner) || !entry.file_type()?.is_file() {
            continue;
        }
        removed += usize::from(fs::remove_file(entry.path()).is_ok());
    }
    Ok(removed)
}
