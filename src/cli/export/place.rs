//! Paths as other hosts are to see them.

use std::path::{Path, PathBuf};

use super::super::CliError;
use crate::manifest::{named_place, real_dir, without_dots};

/// The directory `path`, absolute, without `.` and `..`. Links stay: on a cluster a link's name often is what
/// hosts have in common, and where it leads is not.
pub(super) fn tidy(path: &Path) -> PathBuf {
    let plain = without_dots(path);
    // Unless `..` goes past a link.
    let real = real_dir(path);
    if real_dir(&plain) == real {
        plain
    } else {
        real
    }
}

/// The directory that all `files` are in, at whatever depth; None if they share but the root.
pub(super) fn common_dir(files: &[PathBuf]) -> Option<PathBuf> {
    let mut dirs = files.iter().filter_map(|file| file.parent());
    let mut common = tidy(dirs.next()?);
    let mut last = None;
    for dir in dirs {
        // Files mostly lie in one directory.
        if last == Some(dir) {
            continue;
        }
        last = Some(dir);
        let dir = tidy(dir);
        while !dir.starts_with(&common) {
            common.pop();
        }
    }
    common.parent().is_some().then_some(common)
}

/// `path` as seen from `dir`, both absolute; None if it is not in there.
pub(super) fn inside(path: &Path, dir: &Path) -> Option<PathBuf> {
    let place = match path.strip_prefix(dir) {
        Ok(place) => place.to_owned(),
        // They may be named by different links.
        Err(_) => named_place(path)
            .strip_prefix(real_dir(dir))
            .ok()?
            .to_owned(),
    };
    Some(if place.as_os_str().is_empty() {
        ".".into()
    } else {
        place
    })
}

/// What a queue can call the job of a manifest: the file's name, or its directory's if it is just `job.toml`.
pub(super) fn job_name(manifest: &Path) -> String {
    let stem = manifest.file_stem().unwrap_or_default();
    let dir = manifest.parent().and_then(Path::file_name);
    let name = if stem == "job" {
        dir.unwrap_or(stem)
    } else {
        stem
    };
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
    fn dots_go_and_links_stay() {
        let temporary = tempfile::tempdir().unwrap();
        let dir = temporary.path().canonicalize().unwrap();
        std::fs::create_dir_all(dir.join("real/deep")).unwrap();
        std::os::unix::fs::symlink(dir.join("real/deep"), dir.join("link")).unwrap();
        assert_eq!(tidy(&dir.join("./link/x/../y")), dir.join("link/y"));
        // Past the link, `..` is another directory than the name says.
        assert_eq!(tidy(&dir.join("link/../y")), dir.join("real/y"));
    }

    #[test]
    fn inputs_share_a_directory() {
        let common = |files: &[&str]| {
            let files: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
            common_dir(&files)
        };
        assert_eq!(common(&["/a/b/1.vtk", "/a/b/2.vtk"]), Some("/a/b".into()));
        assert_eq!(
            common(&["/a/b/1", "/a/bc/1", "/a/b/c/2"]),
            Some("/a".into())
        );
        assert_eq!(common(&["/a/1", "/b/1"]), None);
        assert_eq!(common(&[]), None);
    }

    #[test]
    fn only_what_is_below_is_inside() {
        let seen = |path: &str, dir: &str| inside(Path::new(path), Path::new(dir));
        assert_eq!(seen("/a/b/c", "/a"), Some("b/c".into()));
        assert_eq!(seen("/a/b", "/a/b"), Some(".".into()));
        assert_eq!(seen("/a/bc", "/a/b"), None);
        let temporary = tempfile::tempdir().unwrap();
        let dir = temporary.path().canonicalize().unwrap();
        std::fs::create_dir(dir.join("real")).unwrap();
        std::os::unix::fs::symlink(dir.join("real"), dir.join("link")).unwrap();
        assert_eq!(
            inside(&dir.join("real/x"), &dir.join("link")),
            Some("x".into())
        );
    }

    #[test]
    fn jobs_are_called_by_what_tells_them_apart() {
        assert_eq!(job_name(Path::new("/data/dam/job.toml")), "dam");
        assert_eq!(job_name(Path::new("/data/dam/night.toml")), "night");
        assert_eq!(job_name(Path::new("/job.toml")), "job");
    }
}
