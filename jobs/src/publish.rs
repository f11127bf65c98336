//! Files that appear under their name complete or not at all. They are written under a temporary name in the
//! same directory, synced and renamed, and the directory is synced.
//!
//! Temporary files are called `.NAME.OWNER.N.part`. The owner distinguishes files of killed processes from those
//! that are being written, also across machines that share the file system.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::process::owner;

/// The temporary files that this process is writing.
static OPEN_PARTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file being written. Dropped without [`Publisher::commit`], it leaves nothing behind.
#[derive(Debug)]
pub struct Publisher {
    dst: PathBuf,
    part: PathBuf,
    file: Option<BufWriter<File>>,
}

impl Publisher {
    /// Starts a file that will be called `dst`; its directory must exist.
    ///
    /// # Errors
    /// `dst` has no file name, or the temporary cannot be created.
    pub fn create(dst: &Path) -> io::Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let name = dst
            .file_name()
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
        let mut part = OsString::from(".");
        part.push(name);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        part.push(format!(".{}.{count}.part", owner()));
        let part = dst.with_file_name(part);
        let mut open = open_parts();
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(true)
            .open(&part)?;
        open.push(part.clone());
        drop(open);
        Ok(Self {
            dst: dst.to_owned(),
            part,
            file: Some(BufWriter::with_capacity(1 << 18, file)),
        })
    }

    /// Gives the file its name, replacing an older one, once all bytes are on the disk; returns
    /// its length.
    ///
    /// # Errors
    /// Anything the file system says; the temporary is then removed.
    pub fn commit(mut self) -> io::Result<u64> {
        let mut writer = self.file.take().expect("the file is taken here only");
        let result = writer.flush().and_then(|()| {
            let file = writer.get_ref();
            file.sync_all()?;
            let length = file.metadata()?.len();
            fs::rename(&self.part, &self.dst)?;
            sync_directory(&self.dst)?;
            Ok(length)
        });
        if result.is_err() {
            discard(writer, &self.part);
        }
        open_parts().retain(|part| *part != self.part);
        result
    }

    fn writer(&mut self) -> &mut BufWriter<File> {
        self.file.as_mut().expect("present until commit")
    }
}

impl Write for Publisher {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer().flush()
    }
}

impl Seek for Publisher {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer().seek(to)
    }
}

impl Drop for Publisher {
    fn drop(&mut self) {
        if let Some(writer) = self.file.take() {
            discard(writer, &self.part);
            open_parts().retain(|part| *part != self.part);
        }
    }
}

fn open_parts() -> MutexGuard<'static, Vec<PathBuf>> {
    // A list of paths is whole after every step.
    OPEN_PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all temporary files that this process is writing. For a process that ends while its threads still
/// write: from here on none of them can begin a file.
pub fn discard_own_parts() {
    let mut open = open_parts();
    for part in open.drain(..) {
        let _ = fs::remove_file(part);
    }
    // Never unlocked, so that whoever wants to begin a file waits for the end.
    std::mem::forget(open);
}

/// Closes without writing what is still buffered, and removes.
fn discard(writer: BufWriter<File>, part: &Path) {
    drop(writer.into_parts());
    let _ = fs::remove_file(part);
}

/// `bytes` appear at `dst` whole or not at all.
///
/// # Errors
/// Anything the file system says; nothing is left behind then.
pub fn publish(dst: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = Publisher::create(dst)?;
    file.write_all(bytes)?;
    file.commit().map(|_| ())
}

/// What `write` writes appears at `dst` whole, or not at all if it fails; returns the length.
///
/// # Errors
/// What `write` returns, or anything the file system says; nothing is left behind then.
pub fn publish_with<E: From<io::Error>>(
    dst: &Path,
    write: impl FnOnce(&mut Publisher) -> Result<(), E>,
) -> Result<u64, E> {
    let mut file = Publisher::create(dst)?;
    write(&mut file)?;
    Ok(file.commit()?)
}

/// Makes a rename in the directory of `path` outlive a power cut.
fn sync_directory(path: &Path) -> io::Result<()> {
    if cfg!(unix) {
        let parent = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        match File::open(parent)?.sync_all() {
            // Some network file systems cannot; the rename itself has succeeded.
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported
                ) =>
            {
                Ok(())
            }
            other => other,
        }
    } else {
        Ok(())
    }
}

/// Who writes, or wrote, the temporary file `name`: `.NAME.OWNER.N.part`. None for other files.
pub(crate) fn part_owner(name: &str) -> Option<&str> {
    let middle = name.strip_prefix('.')?.strip_suffix(".part")?;
    let mut pieces = middle.rsplitn(3, '.');
    let count = pieces.next()?;
    let owner = pieces.next()?;
    let is_number = !count.is_empty() && count.bytes().all(|b| b.is_ascii_digit());
    let is_owner = owner.split('-').count() >= 3;
    let is_named = pieces.next().is_some_and(|n| !n.is_empty());
    (is_number && is_owner && is_named).then_some(owner)
}

/// Removes the temporary files for `dst` that the worker `owner` has left.
///
/// # Errors
/// Trouble reading the directory.
pub fn discard_parts(dst: &Path, owner: &str) -> io::Result<()> {
    let (Some(dir), Some(name)) = (dst.parent(), dst.file_name().and_then(|n| n.to_str())) else {
        return Ok(());
    };
    let prefix = format!(".{name}.{owner}.");
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        let is_left = |name: &str| name.starts_with(&prefix) && part_owner(name) == Some(owner);
        if entry.file_name().to_str().is_some_and(is_left) {
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::remove_stale_parts;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(dir)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn appears_whole_and_alone() {
        let dir = tempfile::tempdir().unwrap();
        let dst = dir.path().join("a.exr");
        publish(&dst, b"old").unwrap();
        let length = publish_with::<io::Error>(&dst, |file| {
            file.write_all(b"....new bytes")?;
            file.seek(SeekFrom::Start(0))?;
            file.write_all(b"head")
        })
        .unwrap();
        assert_eq!(length, 13);
        assert_eq!(fs::read(&dst).unwrap(), b"headnew bytes".map(|b| b));
        assert_eq!(names(dir.path()), ["a.exr"]);
    }

    #[test]
    fn failure_leaves_the_old_file_and_no_other() {
        let dir = tempfile::tempdir().unwrap();
        let dst = dir.path().join("a.exr");
        publish(&dst, b"old").unwrap();
        let failed = publish_with::<io::Error>(&dst, |file| {
            file.write_all(b"half")?;
            Err(io::Error::other("encoder gave up"))
        });
        assert!(failed.is_err());
        drop(Publisher::create(&dst).unwrap());
        assert_eq!(fs::read(&dst).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a.exr"]);

        let taken = dir.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(publish(&taken, b"x").is_err());
        assert_eq!(names(dir.path()), ["a.exr", "taken"]);
        assert!(publish(&dir.path().join("no/such"), b"x").is_err());
        assert!(publish(Path::new("/"), b"x").is_err());
    }

    #[test]
    fn what_is_being_written_is_known() {
        let dir = tempfile::tempdir().unwrap();
        let dst = dir.path().join("a.exr");
        for commits in [true, false] {
            let file = Publisher::create(&dst).unwrap();
            let part = file.part.clone();
            assert!(open_parts().contains(&part));
            if commits {
                file.commit().unwrap();
            } else {
                drop(file);
            }
            assert!(!open_parts().contains(&part));
        }
    }

    #[test]
    fn only_leftovers_of_the_dead_go() {
        let dir = tempfile::tempdir().unwrap();
        let keep = [
            "notes.part",
            ".a.exr.part",
            ".a.exr.h-1-ff.part",
            ".a.exr.12.1.part",
            ".h-1-ff.1.part",
            "a.h-1-ff.2.part",
            ".a.exr.h-2-ff.7.part",
        ];
        for name in keep {
            fs::write(dir.path().join(name), b"mine").unwrap();
        }
        fs::write(dir.path().join(".a.exr.h-1-ff.0.part"), b"dead").unwrap();
        let mut living = Publisher::create(&dir.path().join("b.exr")).unwrap();
        living.write_all(b"x").unwrap();
        let living_owners = [owner(), "h-2-ff"].map(str::to_owned).into();
        assert_eq!(remove_stale_parts(dir.path(), &living_owners).unwrap(), 1);
        living.commit().unwrap();
        assert_eq!(names(dir.path()).len(), keep.len() + 1);

        discard_parts(&dir.path().join("a.exr"), "h-2-ff").unwrap();
        assert_eq!(names(dir.path()).len(), keep.len());
    }
}
