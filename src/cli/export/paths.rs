//! Paths for use on other hosts.

use std::path::{Path, PathBuf};

use super::super::CliError;
use crate::manifest::{self, named_place, real_dir};

/// The directory `path`, absolute, without `.` and `..`. Links are kept: on a cluster, hosts often share the name of
/// a link but not its target.
pub(super) fn normalized(path: &Path) -> PathBuf {
    let plain = manifest::without_dots(path);
    // `..` after a link leads to another directory
    let real = real_dir(path);
    if real_dir(&plain) == real { plain } else { real }
}

/// The common ancestor directory of all `files`; None if it is the root.
pub(super) fn common_dir(files: &[PathBuf]) -> Option<PathBuf> {
    let mut dirs = files.iter().filter_map(|file| file.parent());
    let mut common = normalized(dirs.next()?);
    let mut last = None;
    for dir in dirs {
        // Most files are in the same directory
        if last == Some(dir) {
            continue;
        }
        last = Some(dir);
        let dir = normalized(dir);
        while !dir.starts_with(&common) {
            common.pop();
        }
    }
    common.parent().is_some().then_some(common)
}

/// `path` relative to `dir`, both absolute; None if it is not inside.
pub(super) fn inside(path: &Path, dir: &Path) -> Option<PathBuf> {
    let relative = match path.strip_prefix(dir) {
        Ok(relative) => relative.to_owned(),
        // The paths may contain different links
        Err(_) => named_place(path).strip_prefix(real_dir(dir)).ok()?.to_owned(),
    };
    Some(if relative.as_os_str().is_empty() { ".".into() } else { relative })
}

/// The name of a job in a queue: that of the manifest, or of its directory if the manifest is `job.toml`.
pub(super) fn job_name(manifest: &Path) -> String {
    let stem = manifest.file_stem().unwrap_or_default();
    let dir = manifest.parent().and_then(Path::file_name);
    let name = if stem == "job" { dir.unwrap_or(stem) } else { stem };
    name.to_string_lossy().into_owned()
}

/// `path` as text; scripts are UTF-8.
pub(super) fn text(path: &Path) -> Result<&str, CliError> {
    let wrong = || CliError::other(format!("{}: the path is not UTF-8", path.display()));
    path.to_str().ok_or_else(wrong)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn dots_are_removed_and_links_kept() {
        let temporary = tempfile::tempdir().unwrap();
        let dir = temporary.path().canonicalize().unwrap();
        std::fs::create_dir_all(dir.join("real/deep")).unwrap();
        std::os::unix::fs::symlink(dir.join("real/deep"), dir.join("link")).unwrap();
        assert_eq!(normalized(&dir.join("./link/x/../y")), dir.join("link/y"));
        // After the link, `..` is another directory
        assert_eq!(normalized(&dir.join("link/../y")), dir.join("real/y"));
    }

    #[test]
    fn common_directories() {
        let common = |files: &[&str]| {
            let files: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
            common_dir(&files)
        };
        assert_eq!(common(&["/a/b/1.vtk", "/a/b/2.vtk"]), Some("/a/b".into()));
        assert_eq!(common(&["/a/b/1", "/a/bc/1", "/a/b/c/2"]), Some("/a".into()));
        assert_eq!(common(&["/a/1", "/b/1"]), None);
        assert_eq!(common(&[]), None);
    }

    #[test]
    fn relative_paths_inside_a_directory() {
        let inside_of = |path: &str, dir: &str| inside(Path::new(path), Path::new(dir));
        assert_eq!(inside_of("/a/b/c", "/a"), Some("b/c".into()));
        assert_eq!(inside_of("/a/b", "/a/b"), Some(".".into()));
        assert_eq!(inside_of("/a/bc", "/a/b"), None);
        let temporary = tempfile::tempdir().unwrap();
        let dir = temporary.path().canonicalize().unwrap();
        std::fs::create_dir(dir.join("real")).unwrap();
        std::os::unix::fs::symlink(dir.join("real"), dir.join("link")).unwrap();
        assert_eq!(inside(&dir.join("real/x"), &dir.join("link")), Some("x".into()));
    }

    #[test]
    fn job_names() {
        assert_eq!(job_name(Path::new("/data/dam/job.toml")), "dam");
        assert_eq!(job_name(Path::new("/data/dam/night.toml")), "night");
        assert_eq!(job_name(Path::new("/job.toml")), "job");
    }
}
