//! An unnamed file for data that does not fit into memory. A thread writes it in slots of equal size.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::FrameError;

/// A file that is deleted when it is dropped; on Unix its name is removed right after creation.
#[derive(Debug)]
pub(super) struct ScratchFile {
    /// The directory that error messages name.
    dir: PathBuf,
    file: File,
    /// The path, on systems where the file keeps its name.
    #[cfg(not(unix))]
    path: PathBuf,
}

impl ScratchFile {
    /// A new file in `dir`.
    ///
    /// # Errors
    /// [`FrameError::Io`].
    pub(super) fn create(dir: &Path) -> Result<Self, FrameError> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = dir.join(format!(".spherule.{}-{count}.part", std::process::id()));
        let io = |e| FrameError::io(&path, e);
        let mut options = OpenOptions::new();
        let file = options.read(true).write(true).create_new(true).open(&path).map_err(io)?;
        if cfg!(unix) {
            fs::remove_file(&path).map_err(io)?;
        }
        Ok(Self {
            dir: dir.to_owned(),
            file,
            #[cfg(not(unix))]
            path,
        })
    }

    /// Writes `bytes` at byte offset `at`.
    pub(super) fn write(&self, bytes: &[u8], at: u64) -> Result<(), FrameError> {
        self.write_at(bytes, at).map_err(|e| FrameError::io(&self.dir, e))
    }

    /// Reads data that was written, from byte offset `at`.
    pub(super) fn read(&self, bytes: &mut [u8], at: u64) -> Result<(), FrameError> {
        self.read_at(bytes, at).map_err(|e| FrameError::io(&self.dir, e))
    }

    #[cfg(unix)]
    fn write_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::write_all_at(&self.file, bytes, at)
    }

    #[cfg(unix)]
    fn read_at(&self, bytes: &mut [u8], at: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, bytes, at)
    }

    #[cfg(windows)]
    fn write_at(&self, mut bytes: &[u8], mut at: u64) -> io::Result<()> {
        use std::os::windows::fs::FileExt;
        while !bytes.is_empty() {
            let written = self.file.seek_write(bytes, at)?;
            if written == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            bytes = &bytes[written..];
            at += written as u64;
        }
        Ok(())
    }

    #[cfg(windows)]
    fn read_at(&self, mut bytes: &mut [u8], mut at: u64) -> io::Result<()> {
        use std::os::windows::fs::FileExt;
        while !bytes.is_empty() {
            let read = self.file.seek_read(bytes, at)?;
            if read == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            bytes = &mut bytes[read..];
            at += read as u64;
        }
        Ok(())
    }
}

#[cfg(not(unix))]
impl Drop for ScratchFile {
    fn drop(&mut self) {
        // Windows removes it once the handle is closed; a failure is not reported.
        let _ = fs::remove_file(&self.path);
    }
}
