//! Makes a rename durable across a power loss, where the file system can.

use std::io;
use std::path::Path;

/// Syncs the directory of `path`.
///
/// # Errors
/// [`io::Error`] of a disk that fails or is full. It is not an error if directories cannot be synced: the rename
/// itself has succeeded.
#[cfg(unix)]
pub(crate) fn sync_directory(path: &Path) -> io::Result<()> {
    let parent = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::File::open(parent).and_then(|directory| directory.sync_all())
}

/// Directories cannot be opened.
#[cfg(not(unix))]
pub(crate) fn sync_directory(_path: &Path) -> io::Result<()> {
    Ok(())
}

/// Whether `error` says that this directory cannot be synced at all, as on some network and FUSE file systems, or
/// in a directory that may be written but not read. PostgreSQL ignores the same errors in `fsync_fname_ext`.
pub(crate) fn cannot_sync(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    #[cfg(unix)]
    let is_bad_file = rustix::io::Errno::from_io_error(error) == Some(rustix::io::Errno::BADF);
    #[cfg(not(unix))]
    let is_bad_file = false;
    // Invalid input is EINVAL; unsupported is ENOSYS or EOPNOTSUPP
    let is_refused = matches!(
        error.kind(),
        Kind::InvalidInput | Kind::Unsupported | Kind::PermissionDenied | Kind::IsADirectory
    );
    is_bad_file || is_refused
}
