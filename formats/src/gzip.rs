//! gzip files: their signature, and their decompressed length.

use std::fs::{self, File};
use std::io::{self, Read, Seek};
use std::path::Path;

/// Checks magic, method deflate and reserved flags: four bytes, so that raw floats do not look like gzip.
pub(crate) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b, 8]) && bytes.get(3).is_none_or(|flags| flags & 0xe0 == 0)
}

/// The decompressed length of the file at `path`, from the last four bytes of a gzip file (RFC 1952), without
/// reading the rest. It is an estimate if the file has several members or more than 4 GiB.
///
/// # Errors
/// [`io::Error`] if the file cannot be read.
pub fn unpacked_len(path: &Path) -> io::Result<u64> {
    // Opening a pipe would block until it has a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let mut file = File::open(path)?;
    let len = file.metadata()?.len();
    let mut start = [0; 4];
    let mut end = [0; 4];
    if len < 18 {
        return Ok(len);
    }
    file.read_exact(&mut start)?;
    if !is_gzip(&start) {
        return Ok(len);
    }
    file.seek(io::SeekFrom::End(-4))?;
    file.read_exact(&mut end)?;
    Ok(u64::from(u32::from_le_bytes(end)).max(len))
}
