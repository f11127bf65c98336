//! Checks an output directory without writing to it.

use std::path::{Path, PathBuf};

/// `dir` itself if it exists, otherwise its nearest existing ancestor.
pub(super) fn nearest_existing(dir: &Path) -> PathBuf {
    let found = dir.ancestors().find(|p| p.exists());
    found.unwrap_or(Path::new("/")).to_owned()
}

/// Checks that the permissions of the directory `dir` allow to create files.
///
/// # Errors
/// The error that creating a file would give.
#[cfg(unix)]
pub(super) fn check_writable(dir: &Path) -> Result<(), std::io::Error> {
    use rustix::fs::Access;
    Ok(rustix::fs::access(dir, Access::WRITE_OK | Access::EXEC_OK)?)
}

/// Free bytes on the file system of `dir`; None if unknown.
#[cfg(unix)]
pub(super) fn free(dir: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(dir).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize))
}

/// Not available on this system.
#[cfg(not(unix))]
pub(super) fn check_writable(_dir: &Path) -> Result<(), std::io::Error> {
    Ok(())
}

/// Not available on this system.
#[cfg(not(unix))]
pub(super) fn free(_dir: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_existing_directory() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(nearest_existing(&dir.path().join("a/b")), dir.path());
        assert_eq!(nearest_existing(dir.path()), dir.path());
    }

    #[cfg(unix)]
    #[test]
    fn a_temporary_directory_is_writable() {
        let dir = tempfile::tempdir().unwrap();
        assert!(check_writable(dir.path()).is_ok());
        assert!(free(dir.path()) > Some(0));
        assert!(check_writable(&dir.path().join("none")).is_err());
    }
}
