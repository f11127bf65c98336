//! Files that appear at their name whole or not at all: written under a temporary name in the
//! same directory, synced, renamed, and the directory synced too.
//!
//! A temporary is called `.NAME.PID.N.part` and stays locked while it is written, so that what a
//! killed run left behind can be told from what a living one is writing, also across machines
//! that share the file system (where it has locks).

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

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
        part.push(format!(".{}.{count}.part", std::process::id()));
        let part = dst.with_file_name(part);
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(true)
            .open(&part)?;
        // Where locks are unknown, leftovers are merely not cleaned.
        let _ = file.try_lock();
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
        }
    }
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

/// Removes the temporaries that dead runs left in `dir`; what is still being written stays.
/// Returns how many were removed.
pub(crate) fn remove_leftovers(dir: &Path) -> io::Result<usize> {
    let mut removed = 0;
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        let is_ours = entry.file_name().to_str().is_some_and(is_part_name);
        if !is_ours || !entry.file_type()?.is_file() {
            continue;
        }
        let Ok(file) = OpenOptions::new().write(true).open(entry.path()) else {
            continue;
        };
        if file.try_lock().is_ok() && fs::remove_file(entry.path()).is_ok() {
            removed += 1;
        }
    }
    Ok(removed)
}

/// `.NAME.PID.N.part`
fn is_part_name(name: &str) -> bool {
    let is_number = |s: &str| !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit());
    let Some(middle) = name.strip_prefix('.').and_then(|n| n.strip_suffix(".part")) else {
        return false;
    };
    let mut pieces = middle.rsplitn(3, '.');
    pieces.next().is_some_and(is_number)
        && pieces.next().is_some_and(is_number)
        && pieces.next().is_some_and(|n| !n.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn only_dead_leftovers_go() {
        let dir = tempfile::tempdir().unwrap();
        let keep = [
            "notes.part",
            ".a.exr.part",
            ".a.exr.12.part",
            ".a.exr.x.1.part",
            "a.1.2.part",
        ];
        for name in keep {
            fs::write(dir.path().join(name), b"mine").unwrap();
        }
        fs::write(dir.path().join(".a.exr.123.0.part"), b"dead").unwrap();
        let own = format!(".a.exr.{}.999.part", std::process::id());
        fs::write(dir.path().join(own), b"dead, same process id").unwrap();
        let mut living = Publisher::create(&dir.path().join("b.exr")).unwrap();
        living.write_all(b"x").unwrap();
        assert_eq!(remove_leftovers(dir.path()).unwrap(), 2);
        living.commit().unwrap();
        assert_eq!(names(dir.path()).len(), keep.len() + 1);
    }
}
