//! Errors on files, divided by what the user can do about them.

use std::io;
use std::path::{Path, PathBuf};

/// A file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file or its directory is not writable.
    #[error("{}: cannot be written ({source})", path.display())]
    Unwritable {
        /// The file or directory.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The disk is full. Existing files are intact.
    #[error("{}: no space left", path.display())]
    DiskFull {
        /// The file that was being written.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Any other error.
    #[error("{}: {action}: {source}", path.display())]
    Other {
        /// The file or directory.
        path: PathBuf,
        /// What failed.
        action: &'static str,
        /// The error of the operating system.
        source: io::Error,
    },
}

impl FileError {
    /// The error for the file at `path` on which `action` failed. The kind of the I/O error decides the variant.
    pub fn new(path: &Path, action: &'static str, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                Self::DiskFull { path, source }
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::Unwritable { path, source }
            }
            _ => Self::Other { path, action, source },
        }
    }
}
