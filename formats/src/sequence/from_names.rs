//! The frames that files of given names make, for fuzzing: no file is looked at.

use std::path::{Path, PathBuf};

use super::SequenceError;
use super::group::{self, FileGroup};
use super::name::FileName;
use super::pattern::Pattern;

/// A file with its frame number, if its name has one, and the index of its part.
type NumberedFile = (PathBuf, Option<i64>, u32);

/// The frames of files of these `names`: of a directory with these files, or with a `pattern`, of those that fit it.
///
/// # Errors
/// As [`super::Sequence::open`].
#[doc(hidden)]
pub fn frames_of_names(
    pattern: Option<&Path>,
    names: &[&Path],
) -> Result<Vec<NumberedFile>, SequenceError> {
    let names = match pattern.map(Pattern::parse).transpose()? {
        None => names.iter().map(|name| FileName::parse(name, None)).collect(),
        Some(pattern) => names.iter().filter_map(|name| fitting(&pattern, name)).collect(),
    };
    numbered(group::pick(Path::new("."), names, &mut Vec::new())?)
}

/// The frames of files that are listed by these `names`.
///
/// # Errors
/// As [`super::Sequence::open`].
#[doc(hidden)]
pub fn frames_of_list(names: &[&Path]) -> Result<Vec<NumberedFile>, SequenceError> {
    let names = names.iter().map(|name| FileName::parse(name, None)).collect();
    numbered(group::listed(names, &mut Vec::new())?)
}

fn fitting(pattern: &Pattern, path: &Path) -> Option<FileName> {
    let name = path.file_name()?.to_string_lossy();
    Some(FileName::parse(path, pattern.fit(&name)?.number))
}

fn numbered(group: FileGroup) -> Result<Vec<NumberedFile>, SequenceError> {
    let files = group.files.into_iter();
    Ok(files.map(|file| (file.path, file.number, file.part)).collect())
}
