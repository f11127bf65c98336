//! Paths as users type them.

use std::env;
use std::path::{Path, PathBuf};

use super::CliError;

/// `path` for a manifest. A typed path is relative to the working directory; a path in a manifest from a file is relative
/// to the file, so it is made absolute.
pub(super) fn path_as_typed(path: &str, from_file: bool) -> Result<String, CliError> {
    if from_file { text(&absolute(Path::new(path))?) } else { Ok(path.to_owned()) }
}

/// `path` from the root, without looking at what is there.
pub(super) fn absolute(path: &Path) -> Result<PathBuf, CliError> {
    if path.as_os_str().is_empty() {
        return env::current_dir().map_err(CliError::io(Path::new(".")));
    }
    std::path::absolute(path).map_err(CliError::io(path))
}

/// `path` as text.
pub(super) fn text(path: &Path) -> Result<String, CliError> {
    let text = path.to_str().map(str::to_owned);
    text.ok_or_else(|| CliError::other(format!("{}: the path is not UTF-8", path.display())))
}
