//! What can be known of a place for images without writing there.

use std::path::{Path, PathBuf};

/// The part of `dir` that is there: `dir` itself, or the nearest directory above it.
pub(super) fn existing(dir: &Path) -> PathBuf {
    let found = dir.ancestors().find(|p| p.exists());
    found.unwrap_or(Path::new("/")).to_owned()
}

/// Whether files can be made in the directory `dir`, as far as its permissions tell.
///
/// # Errors
/// Why not.
#[cfg(unix)]
pub(super) fn writable(dir: &Path) -> Result<(), std::io::Error> {
    use rustix::fs::Access;
    Ok(rustix::fs::access(dir, Access::WRITE_OK | Access::EXEC_OK)?)
}

/// Bytes that can still be written to the file system of `dir`; None where the system does not tell.
#[cfg(unix)]
pub(super) fn free(dir: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(dir).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize))
}

/// Not known here.
#[cfg(not(unix))]
pub(super) fn writable(_dir: &Path) -> Result<(), std::io::Error> {
    Ok(())
}

/// Not known here.
#[cfg(not(unix))]
pub(super) fn free(_dir: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_directory_that_is_there() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(existing(&dir.path().join("a/b")), dir.path());
        assert_eq!(existing(dir.path()), dir.path());
    }

    #[cfg(unix)]
    #[test]
    fn a_temporary_directory_has_room() {
        let dir = tempfile::tempdir().unwrap();
        assert!(writable(dir.path()).is_ok());
        assert!(free(dir.path()) > Some(0));
        assert!(writable(&dir.path().join("none")).is_err());
    }
}
