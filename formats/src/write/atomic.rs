//! Files that appear complete or not at all.
//!
//! Temporary files are called `.NAME.OWNER.N.part`. The owner in the name shows a process that resumes work in
//! the directory which files a killed process left there.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// A file under a temporary name in the directory of its final name. Dropping it before it is published removes it.
#[derive(Debug)]
pub(crate) struct Unpublished {
    path: PathBuf,
    part: PathBuf,
    file: File,
    is_published: bool,
}

impl Unpublished {
    /// Creates the temporary file for `path`.
    ///
    /// # Errors
    /// [`io::Error`] of creating the file.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let part = temporary_name(path)?;
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .open(&part)?;
        Ok(Self {
            path: path.to_owned(),
            part,
            file,
            is_published: false,
        })
    }

    /// Writes `bytes` at byte offset `at`.
    ///
    /// # Errors
    /// [`io::Error`] of writing.
    #[cfg(unix)]
    pub(crate) fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::write_all_at(&self.file, bytes, at)
    }

    /// Writes `bytes` at byte offset `at`.
    ///
    /// # Errors
    /// [`io::Error`] of writing.
    #[cfg(not(unix))]
    pub(crate) fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        use std::io::{Seek, SeekFrom};
        let mut file = &self.file;
        file.seek(SeekFrom::Start(at))?;
        file.write_all(bytes)
    }

    /// Syncs the file and renames it to its final name.
    ///
    /// # Errors
    /// [`io::Error`] of syncing or renaming; in that case the temporary file is removed.
    pub(crate) fn publish(mut self) -> io::Result<()> {
        self.file.sync_all()?;
        fs::rename(&self.part, &self.path)?;
        self.is_published = true;
        sync_directory(&self.path)
    }
}

impl Drop for Unpublished {
    fn drop(&mut self) {
        if !self.is_published {
            // The error that prevented publishing is the one to report.
            let _ = fs::remove_file(&self.part);
        }
    }
}

/// Writes a temporary file in the directory of `path` with `fill`, syncs it and renames it to `path`.
///
/// # Errors
/// [`io::Error`] of creating, writing, syncing or renaming; in that case the temporary file is removed.
pub(crate) fn publish<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>,
) -> Result<(), E> {
    let file = Unpublished::create(path)?;
    let mut writer = BufWriter::with_capacity(1 << 18, &file.file);
    fill(&mut writer)?;
    writer.flush()?;
    drop(writer);
    Ok(file.publish()?)
}

static OWNER: OnceLock<String> = OnceLock::new();

/// Sets the owner in the names of this process's temporary files, which must not contain dots; the default is
/// the process id. Call it once, before the first file is created.
pub fn own_temporaries(owner: &str) {
    let _ = OWNER.set(owner.to_owned());
}

/// The name is hidden and ends in `.part`, so that no listing mistakes the file for a frame. It is distinct for
/// each live process and each call.
fn temporary_name(path: &Path) -> io::Result<PathBuf> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "no file name to write to"))?;
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let mut part = std::ffi::OsString::from(".");
    part.push(name);
    let owner = OWNER.get_or_init(|| std::process::id().to_string());
    part.push(format!(".{owner}.{count}.part"));
    Ok(path.with_file_name(part))
}

/// Makes the rename durable across a power loss, on systems where directories can be opened.
fn sync_directory(path: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    match path.parent() {
        Some(parent) if parent != Path::new("") => File::open(parent)?.sync_all(),
        _ => File::open(".")?.sync_all(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let path = dir.path().join("a.spf");
        publish(&path, |w| w.write_all(b"old")).expect("writable");
        let failed = publish(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("full"))
        });
        assert_eq!(failed.expect_err("told").to_string(), "full");
        assert_eq!(fs::read(&path).expect("readable"), b"old");
        assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 1);
    }
}
