//! Creates names exclusively, lists worker records, and removes stale files.

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use spherule_files::part_owner;

use super::{RECORD_SUFFIX, WorkerRecord};

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
        path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(RECORD_SUFFIX))
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

/// Temporary files that were listed before the living workers were: an owner that is not among those has ended, because
/// workers register before they write. The other way around, a worker that registers in between would lose its files.
#[derive(Debug, Default)]
pub(crate) struct ListedParts {
    /// Each with its owner.
    parts: Vec<(PathBuf, String)>,
}

impl ListedParts {
    /// Lists the temporary files in `dir`.
    pub(crate) fn add(&mut self, dir: &Path) -> io::Result<()> {
        for entry in fs::read_dir(dir)? {
            let entry = entry?;
            let name = entry.file_name();
            if let Some(owner) = name.to_str().and_then(part_owner)
                && entry.file_type()?.is_file()
            {
                self.parts.push((entry.path(), owner.to_owned()));
            }
        }
        Ok(())
    }

    /// Removes the files whose owner is not in `living_owners`; returns their count.
    pub(crate) fn remove_stale(&self, living_owners: &HashSet<String>) -> usize {
        let stale = self.parts.iter().filter(|(_, owner)| !living_owners.contains(owner));
        stale.filter(|(path, _)| fs::remove_file(path).is_ok()).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Publisher, owner};

    #[test]
    fn only_parts_of_the_dead_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        let keep = [
            "notes.part",
            ".a.exr.part",
            ".a.exr.h-1-ff.part",
            ".a.exr.12.1.part",
            ".h-1-ff.1.part",
            "a.h-1-ff.2.part",
            ".a.exr.h-2-ff.7.part",
        ];
        for name in keep {
            fs::write(dir.path().join(name), b"mine").unwrap();
        }
        fs::write(dir.path().join(".a.exr.h-1-ff.0.part"), b"dead").unwrap();
        let mut living = Publisher::create(&dir.path().join("b.exr")).unwrap();
        living.write_all(b"x").unwrap();
        let living_owners = [owner(), "h-2-ff"].map(str::to_owned).into();
        let mut parts = ListedParts::default();
        parts.add(dir.path()).unwrap();
        // A worker that is not among the living, because it came after they were listed
        let new = dir.path().join(".c.exr.h-3-ff.0.part");
        fs::write(&new, b"new").unwrap();
        assert_eq!(parts.remove_stale(&living_owners), 1);
        living.commit().unwrap();
        assert!(new.exists());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), keep.len() + 2);
    }
}
