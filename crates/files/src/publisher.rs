//! Writes a file under a temporary name and publishes it.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::directory::{cannot_sync, sync_directory};
use crate::owner::part_path;

/// The temporary files that this process is writing.
static OPEN_PARTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file being written. Dropped without [`Publisher::commit`], it leaves nothing behind.
#[derive(Debug)]
pub struct Publisher {
    dst: PathBuf,
    part: PathBuf,
    file: Option<BufWriter<File>>,
}

/// The last steps of publishing; tests let them fail.
struct LastSteps {
    rename: fn(&Path, &Path) -> io::Result<()>,
    sync_directory: fn(&Path) -> io::Result<()>,
}

const LAST_STEPS: LastSteps = LastSteps { rename: |from, to| fs::rename(from, to), sync_directory };

impl Publisher {
    /// Starts a file that will be called `dst`; its directory must exist.
    ///
    /// # Errors
    /// `dst` has no file name, or the temporary file cannot be created.
    pub fn create(dst: &Path) -> io::Result<Self> {
        let part = part_path(dst)?;
        let mut open = open_parts();
        let file =
            OpenOptions::new().read(true).write(true).create(true).truncate(true).open(&part)?;
        open.push(part.clone());
        drop(open);
        Ok(Self { dst: dst.to_owned(), part, file: Some(BufWriter::with_capacity(1 << 18, file)) })
    }

    /// The temporary file, for another program that writes it by its name. The program must end before
    /// [`Publisher::commit`].
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Syncs the file and renames it to its final name, where it replaces an older one. Returns its length in
    /// bytes.
    ///
    /// # Errors
    /// [`io::Error`] of writing, syncing or renaming; the temporary file is then removed. Also that of syncing
    /// the directory, unless the file system cannot do that at all; the file is then in place, but a power loss
    /// may undo it.
    pub fn commit(self) -> io::Result<u64> {
        self.commit_by(&LAST_STEPS)
    }

    fn commit_by(mut self, steps: &LastSteps) -> io::Result<u64> {
        let mut writer = self.file.take().expect("the file is taken here only");
        let renamed = writer.flush().and_then(|()| {
            let file = writer.get_ref();
            file.sync_all()?;
            let length = file.metadata()?.len();
            (steps.rename)(&self.part, &self.dst)?;
            Ok(length)
        });
        if renamed.is_err() {
            discard(writer, &self.part);
        }
        open_parts().retain(|part| *part != self.part);
        let length = renamed?;
        match (steps.sync_directory)(&self.dst) {
            Err(error) if !cannot_sync(&error) => Err(error),
            _ => Ok(length),
        }
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

/// Writes `bytes` to `dst`. The file appears complete or not at all.
///
/// # Errors
/// Those of [`Publisher::create`] and [`Publisher::commit`].
pub fn publish(dst: &Path, bytes: &[u8]) -> io::Result<()> {
    publish_with(dst, |file| file.write_all(bytes)).map(|_| ())
}

/// Writes `dst` with `write`. The file appears complete, or not at all if `write` fails. Returns its length in
/// bytes.
///
/// # Errors
/// What `write` returns, and those of [`Publisher::create`] and [`Publisher::commit`].
pub fn publish_with<E: From<io::Error>>(
    dst: &Path,
    write: impl FnOnce(&mut Publisher) -> Result<(), E>,
) -> Result<u64, E> {
    let mut file = Publisher::create(dst)?;
    write(&mut file)?;
    Ok(file.commit()?)
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
        assert_eq!(fs::read(&dst).unwrap(), b"headnew bytes");
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
        assert_eq!(failed.unwrap_err().to_string(), "encoder gave up");
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
    fn another_program_may_write_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let dst = dir.path().join("a.mp4");
        let file = Publisher::create(&dst).unwrap();
        fs::write(file.part(), b"by another program").unwrap();
        assert_eq!(file.commit().unwrap(), 18);
        assert_eq!(fs::read(&dst).unwrap(), b"by another program");
        let file = Publisher::create(&dst).unwrap();
        fs::write(file.part(), b"half").unwrap();
        drop(file);
        assert_eq!(fs::read(&dst).unwrap(), b"by another program");
        assert_eq!(names(dir.path()), ["a.mp4"]);
    }

    #[test]
    fn files_that_are_being_written_are_known() {
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

    /// Commits a new file over an old one with these last steps. Returns the result and the file's new content.
    #[cfg(unix)]
    fn commit_by(steps: &LastSteps) -> (io::Result<u64>, Vec<u8>) {
        let dir = tempfile::tempdir().unwrap();
        let dst = dir.path().join("a.exr");
        publish(&dst, b"old").unwrap();
        let mut file = Publisher::create(&dst).unwrap();
        let part = file.part.clone();
        file.write_all(b"new bytes").unwrap();
        let result = file.commit_by(steps);
        assert_eq!(names(dir.path()), ["a.exr"]);
        assert!(!open_parts().contains(&part));
        (result, fs::read(&dst).unwrap())
    }

    #[cfg(unix)]
    #[test]
    fn directories_that_cannot_be_synced_are_no_failure() {
        use rustix::io::Errno;
        /// A sync of the directory that fails with this error.
        macro_rules! failing {
            ($($errno:ident),*) => {
                [$((Errno::$errno, LastSteps {
                    sync_directory: |_| Err(Errno::$errno.into()),
                    ..LAST_STEPS
                })),*]
            };
        }
        for (errno, steps) in failing!(INVAL, NOTSUP, OPNOTSUPP, NOSYS, ACCESS, PERM, BADF, ISDIR) {
            let (result, content) = commit_by(&steps);
            assert_eq!(result.unwrap(), 9, "{errno}");
            assert_eq!(content, b"new bytes");
        }
        for (errno, steps) in failing!(IO, NOSPC, DQUOT, STALE, ROFS, NOENT) {
            let (result, content) = commit_by(&steps);
            let error = result.expect_err("the rename may be undone");
            assert_eq!(Errno::from_io_error(&error), Some(errno));
            assert_eq!(content, b"new bytes");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_failed_rename_leaves_the_old_file_and_no_other() {
        let steps =
            LastSteps { rename: |_, _| Err(rustix::io::Errno::ACCESS.into()), ..LAST_STEPS };
        let (result, content) = commit_by(&steps);
        assert_eq!(result.unwrap_err().kind(), io::ErrorKind::PermissionDenied);
        assert_eq!(content, b"old");
    }

    /// The file that the crashing process writes.
    const CRASH_AT: &str = "SPHERULE_PUBLISH_CRASH_AT";
    const CRASHING_TEST: &str = "publisher::tests::a_crash_before_the_rename_leaves_the_old_file";

    /// Runs itself in a process that crashes. What it leaves can be removed by the owner in its name.
    #[cfg(unix)]
    #[test]
    fn a_crash_before_the_rename_leaves_the_old_file() {
        if let Some(dst) = std::env::var_os(CRASH_AT) {
            let mut file = Publisher::create(Path::new(&dst)).unwrap();
            file.write_all(b"new bytes").unwrap();
            let _ =
                file.commit_by(&LastSteps { rename: |_, _| std::process::abort(), ..LAST_STEPS });
            unreachable!("it has crashed");
        }
        let dir = tempfile::tempdir().unwrap();
        let dst = dir.path().join("a.exr");
        publish(&dst, b"old").unwrap();
        let crashed = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", CRASHING_TEST])
            .env(CRASH_AT, &dst)
            .output()
            .unwrap();
        assert_eq!(crashed.status.code(), None, "{crashed:?}");
        assert_eq!(fs::read(&dst).unwrap(), b"old");
        let left = names(dir.path());
        let [part, other] = left.as_slice() else {
            panic!("{left:?}");
        };
        assert_eq!(other, "a.exr");
        assert_eq!(fs::read(dir.path().join(part)).unwrap(), b"new bytes");
        let owner = crate::part_owner(part).unwrap().to_owned();
        assert_ne!(owner, crate::owner());
        crate::discard_parts(&dst, &owner).unwrap();
        assert_eq!(names(dir.path()), ["a.exr"]);
    }
}
