//! Who writes a temporary file, as its name says.

use std::fs;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

static OWNER: OnceLock<String> = OnceLock::new();

/// Assigns the temporary files of this process to the [`owner`] of another process, which removes them if this
/// process dies. Call it once, before the first file is created.
pub fn set_owner(owner: &str) {
    let _ = OWNER.set(owner.to_owned());
}

/// The owner that the names of temporary files contain: [`process_token`] unless [`set_owner`] was called.
pub fn owner() -> &'static str {
    OWNER.get().map_or_else(process_token, String::as_str)
}

/// Identifies this process on all machines, even if its process number is reused later: `HOST-PID-RANDOM`.
/// Letters, digits, `-` and `_`.
pub fn process_token() -> &'static str {
    static TOKEN: OnceLock<String> = OnceLock::new();
    TOKEN.get_or_init(|| {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let host: String = host_name().chars().map(plain).take(32).collect();
        let unique = RandomState::new().build_hasher().finish();
        format!("{host}-{}-{:08x}", std::process::id(), unique >> 32)
    })
}

/// The name of this machine; empty if it is unknown.
#[cfg(unix)]
pub fn host_name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

/// The name of this machine; empty if it is unknown.
#[cfg(not(unix))]
pub fn host_name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// A temporary name for `dst`. It is hidden, so that no listing mistakes the file for a frame, and distinct for
/// each live process and each call.
pub(crate) fn part_path(dst: &Path) -> io::Result<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = dst
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    let mut part = std::ffi::OsString::from(".");
    part.push(name);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    part.push(format!(".{}.{count}.part", owner()));
    Ok(dst.with_file_name(part))
}

/// The owner of the temporary file `name`: `.NAME.OWNER.N.part`. None for other files.
pub fn part_owner(name: &str) -> Option<&str> {
    let middle = name.strip_prefix('.')?.strip_suffix(".part")?;
    let mut pieces = middle.rsplitn(3, '.');
    let count = pieces.next()?;
    let owner = pieces.next()?;
    let is_number = !count.is_empty() && count.bytes().all(|b| b.is_ascii_digit());
    let is_owner = owner.split('-').count() >= 3;
    let is_named = pieces.next().is_some_and(|n| !n.is_empty());
    (is_number && is_owner && is_named).then_some(owner)
}

/// Removes the temporary files for `dst` that the process `owner` has left.
///
/// # Errors
/// [`io::Error`] of reading the directory.
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

    #[test]
    fn only_names_with_an_owner_are_temporary() {
        let strangers = [
            "notes.part",
            ".a.exr.part",
            ".a.exr.h-1-ff.part",
            ".a.exr.12.1.part",
            ".h-1-ff.1.part",
            "a.h-1-ff.2.part",
        ];
        for name in strangers {
            assert_eq!(part_owner(name), None, "{name}");
        }
        assert_eq!(part_owner(".a.exr.h-1-ff.7.part"), Some("h-1-ff"));
        let own = part_path(Path::new("out/a.exr")).unwrap();
        assert_eq!(own.parent(), Some(Path::new("out")));
        let own = own.file_name().and_then(|name| name.to_str()).unwrap();
        assert_eq!(part_owner(own), Some(process_token()));
        assert!(!process_token().contains('.'));
        assert!(process_token().contains(&std::process::id().to_string()));
    }

    #[test]
    fn the_files_of_one_owner_and_name_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        let names = [".a.exr.h-1-ff.0.part", ".a.exr.h-2-ff.0.part", ".b.exr.h-1-ff.0.part"];
        for name in names {
            fs::write(dir.path().join(name), b"half").unwrap();
        }
        discard_parts(&dir.path().join("a.exr"), "h-1-ff").unwrap();
        let left = names.map(|name| dir.path().join(name).exists());
        assert_eq!(left, [false, true, true]);
    }
}
