//! The input that a user names: a directory, a pattern or files.

use std::collections::HashSet;
use std::path::PathBuf;

use super::error::SequenceError;
use super::name::FileName;
use super::pattern::{self, Pattern};
use super::scan;

/// The input that a user names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SequenceInput {
    /// All particle files of a directory.
    Directory(PathBuf),
    /// `dump.#.vtk`, `frame_####.bgeo`, `%04d`, `*`, `?` in the file name.
    Pattern(PathBuf),
    /// Files, each of which may be a pattern or a directory itself.
    Files(Vec<PathBuf>),
}

impl SequenceInput {
    /// Decides by what is on disk: a directory, one file, or else a pattern if it has wildcards.
    pub fn from_path(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        if path.is_dir() {
            Self::Directory(path)
        } else if !path.exists() && pattern::has_wildcards(&path) {
            Self::Pattern(path)
        } else {
            Self::Files(vec![path])
        }
    }

    /// One argument is read as by [`Self::from_path`], several are files.
    pub fn from_paths(mut paths: Vec<PathBuf>) -> Self {
        match (paths.pop(), paths.is_empty()) {
            (Some(only), true) => Self::from_path(only),
            (Some(last), false) => {
                paths.push(last);
                Self::Files(paths)
            }
            (None, _) => Self::Files(paths),
        }
    }
}

/// The files of a list, its patterns and directories filled in; the same file twice is once.
pub(super) fn listed_names(paths: &[PathBuf]) -> Result<Vec<FileName>, SequenceError> {
    let mut names: Vec<FileName> = Vec::new();
    let mut known = HashSet::new();
    for path in paths {
        // Find the names: patterns and directories stand for many files
        let found = match SequenceInput::from_path(path) {
            SequenceInput::Directory(path) => scan::directory(&path)?,
            SequenceInput::Pattern(path) => scan::fitting(&Pattern::parse(&path)?, &path)?,
            SequenceInput::Files(_) if path.exists() => vec![FileName::parse(path, None)],
            SequenceInput::Files(_) => {
                return Err(SequenceError::missing(path));
            }
        };
        // Keep the first of each
        for name in found {
            if known.insert(name.path.clone()) {
                names.push(name);
            }
        }
    }
    if names.is_empty() {
        return Err(SequenceError::NoInput);
    }
    Ok(names)
}
