//! Reads all of a file that is not a frame.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::regular::FileStamp;
use super::{Decompressor, unpacked_len};
use spherule_frame::{FrameError, MemoryBudget};

/// All bytes of the regular file at `path`, decompressed.
///
/// # Errors
/// [`FrameError`]; [`FrameError::TooLarge`] if there are more bytes than `budget` allows.
pub fn read_whole(path: &Path, budget: MemoryBudget) -> Result<Vec<u8>, FrameError> {
    let stamp = FileStamp::of(path)?;
    let stream = decompressor(path, budget)?;
    let mut len = stamp.len;
    if stream.is_compressed() {
        len = unpacked_len(path).unwrap_or(len);
    } else {
        let fits = budget.check(len, "the file is");
        fits.map_err(|e| e.in_file(path))?;
    }
    let mut bytes = Vec::new();
    // An estimate for compressed files. One byte more, so that the last read finds the end.
    let room = usize::try_from(len.min(budget.bytes())).unwrap_or(usize::MAX);
    let _ = bytes.try_reserve_exact(room.saturating_add(1));
    let read = stream.finish(&mut bytes, budget);
    // A file that changed explains any other fault.
    stamp.check(path)?;
    read.map_err(|e| e.in_file(path))?;
    bytes.shrink_to_fit();
    Ok(bytes)
}

/// The content of the file at `path`, decompressed, from its beginning. The decoder holds no more than `budget`.
///
/// # Errors
/// [`FrameError`] if it cannot be read, or is compressed in a way that is not read.
pub fn decompressor(
    path: &Path,
    budget: MemoryBudget,
) -> Result<Decompressor<BufReader<File>>, FrameError> {
    let file = File::open(path)
        .map(|file| BufReader::with_capacity(1 << 16, file))
        .map_err(|e| FrameError::io(path, e))?;
    Decompressor::new(file, budget).map_err(|e| e.in_file(path))
}
