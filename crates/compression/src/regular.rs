//! Regular files, and detection of changes to them.

use std::fs;
use std::io;
use std::path::Path;
use std::time::SystemTime;

use spherule_frame::{FrameError, ParseError};

/// The length of a regular file, bytes. Other files are refused because reading a pipe or a device could take
/// forever.
///
/// # Errors
/// [`FrameError`] if the file does not exist or is not a regular file.
pub fn regular_len(path: &Path) -> Result<u64, FrameError> {
    let meta = fs::metadata(path).map_err(|e| FrameError::io(path, e))?;
    if meta.is_file() {
        return Ok(meta.len());
    }
    let what = if meta.is_dir() {
        "a directory, where a file was expected"
    } else {
        "not a regular file; copy it to one first"
    };
    Err(ParseError::unsupported(what).in_file(path))
}

/// Length and modification time of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileStamp {
    /// Length in bytes.
    pub len: u64,
    modified: Option<SystemTime>,
}

impl FileStamp {
    /// The stamp of the regular file at `path`.
    ///
    /// # Errors
    /// As [`regular_len`].
    pub fn of(path: &Path) -> Result<Self, FrameError> {
        let len = regular_len(path)?;
        let meta = fs::metadata(path).map_err(|e| FrameError::io(path, e))?;
        Ok(Self { len, modified: meta.modified().ok() })
    }

    /// Checks that the file still has this stamp.
    ///
    /// # Errors
    /// [`FrameError::Io`] if the file has changed.
    pub fn check(self, path: &Path) -> Result<(), FrameError> {
        self.check_same(Self::of(path)?).map_err(|e| FrameError::io(path, e))
    }

    fn check_same(self, now: Self) -> io::Result<()> {
        if self == now {
            return Ok(());
        }
        let what = if self.len == now.len {
            "the file was written to while it was read".to_owned()
        } else {
            let (before, after) = (self.len, now.len);
            format!("the size went from {before} to {after} bytes while it was read")
        };
        Err(io::Error::other(format!("{what}; it is still being written, try again later")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growing_file_is_detected() {
        let stamp = |len, seconds| FileStamp {
            len,
            modified: Some(SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds)),
        };
        assert!(stamp(7, 1).check_same(stamp(7, 1)).is_ok());
        for now in [stamp(8, 1), stamp(6, 2), stamp(7, 2)] {
            let error = stamp(7, 1).check_same(now).expect_err("changed");
            assert!(error.to_string().contains("still being written"));
        }
    }
}
