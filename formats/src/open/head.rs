//! Looks at the first bytes of a file: its format and remarks, without reading the rest.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use flate2::bufread::GzDecoder;

use crate::FrameError;
use crate::detect::Format;
use crate::gzip::is_gzip;
use crate::message::one_line;
use crate::native::{self, MappedFile};
use crate::reader::HEAD_LEN;
use crate::regular::regular_len;

/// Whether the file at `path` begins as a native frame, without gzip around it.
///
/// # Errors
/// [`FrameError`] if the file cannot be read, or is not a regular file.
pub fn is_native(path: &Path) -> Result<bool, FrameError> {
    regular_len(path)?;
    let mut start = [0; native::MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    match read {
        Ok(()) => Ok(start == *native::MAGIC),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(FrameError::io(path, e)),
    }
}

/// The format of the file at `path` by its first bytes, gzip or not. Reads a few KiB at most.
///
/// # Errors
/// As [`super::FrameFile::open`], as far as the first bytes decide.
pub fn detect_file(path: &Path) -> Result<Format, FrameError> {
    let head = head(path)?;
    Format::detect(&head, path).map_err(|e| e.in_file(path))
}

/// What the file at `path` holds that is not in its particles: a cell and periodic boundaries, which are not used, and
/// the names behind numbers. Looks at the first bytes unless the format needs more. Empty for a file that cannot be
/// read.
pub fn remarks(path: &Path) -> Vec<String> {
    let remarks = head(path).and_then(|head| {
        let format = Format::detect(&head, path).map_err(|e| e.in_file(path))?;
        let reader = format.reader();
        if !reader.remarks_need_whole_file() {
            return Ok(reader.remarks(&head));
        }
        let map = MappedFile::open(path)?;
        if is_gzip(map.bytes()) {
            return Ok(reader.remarks(&head));
        }
        let remarks = reader.remarks(map.bytes());
        map.check()?;
        Ok(remarks)
    });
    let remarks = remarks.unwrap_or_default().into_iter();
    remarks.map(one_line).collect()
}

/// The first bytes of the file at `path`, decompressed if it is gzip.
pub(crate) fn head(path: &Path) -> Result<Vec<u8>, FrameError> {
    let io = |e| FrameError::io(path, e);
    regular_len(path)?;
    let mut stored = Vec::new();
    File::open(path)
        .and_then(|f| f.take(4 * HEAD_LEN as u64).read_to_end(&mut stored))
        .map_err(io)?;
    if !is_gzip(&stored) {
        return Ok(stored);
    }
    let mut head = Vec::new();
    // The end is cut off on purpose, so an early end is not a fault here.
    let _ = GzDecoder::new(stored.as_slice())
        .take(HEAD_LEN as u64)
        .read_to_end(&mut head);
    Ok(head)
}
