//! Reads regular files up to a size limit. A file name may lead to a pipe, which blocks until a writer opens it,
//! or to a device without an end.

use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// Opens the regular file at `path` for reading. Follows links.
///
/// # Errors
/// It is a pipe, a device, a socket or a directory, or cannot be opened.
pub fn open_regular(path: &Path) -> io::Result<(File, Metadata)> {
    // Check before opening, which may block, and check the file that was opened
    check(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    check(&metadata)?;
    Ok((file, metadata))
}

/// All bytes of the regular file at `path`.
///
/// # Errors
/// Those of [`open_regular`], or it has more than `limit` bytes.
pub fn read_regular(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let (file, metadata) = open_regular(path)?;
    let mut bytes = Vec::new();
    if metadata.len() <= limit {
        // The file may grow meanwhile
        file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    }
    if metadata.len() > limit || bytes.len() as u64 > limit {
        let what = format!("has more than {limit} bytes, the limit for this kind of file");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}

/// The text of the regular file at `path`.
///
/// # Errors
/// Those of [`read_regular`], or the bytes are not UTF-8.
pub fn read_regular_text(path: &Path, limit: u64) -> io::Result<String> {
    String::from_utf8(read_regular(path, limit)?)
        .map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e.utf8_error()))
}

fn check(metadata: &Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let (kind, what) = if metadata.is_dir() {
        (io::ErrorKind::IsADirectory, "is a directory where a file is expected")
    } else {
        (io::ErrorKind::InvalidInput, "is not a regular file but a pipe, a device or a socket")
    };
    Err(io::Error::new(kind, what))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn refuses(path: &Path, what: &str) {
        let error = read_regular(path, 5).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }

    #[test]
    fn only_regular_files_up_to_the_limit_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        fs::write(&path, "12345").unwrap();
        assert_eq!(read_regular_text(&path, 5).unwrap(), "12345");
        fs::write(&path, "123456").unwrap();
        refuses(&path, "more than 5 bytes");
        refuses(dir.path(), "is a directory");
        refuses(&dir.path().join("none"), "");
        #[cfg(unix)]
        refuses(Path::new("/dev/zero"), "not a regular file");
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_an_error_and_does_not_block() {
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        refuses(&pipe, "not a regular file");
        let link = dir.path().join("link");
        std::os::unix::fs::symlink(&pipe, &link).unwrap();
        refuses(&link, "not a regular file");
    }
}
