//! Sources of particles: particles in memory, mapped native frames, and generators.

mod block;
mod cube;
mod native;
mod raw;

pub use block::{BlockSettings, BlockSource};
pub use cube::BoxSource;
pub use native::NativeSource;
pub use raw::RawSource;

use std::io;
use std::ops::Range;
use std::path::Path;

use crate::FrameError;

/// The range of `len` indices from `first`, if all are below `count`.
pub(super) fn places(
    path: &Path,
    first: u64,
    len: usize,
    count: u64,
) -> Result<Range<usize>, FrameError> {
    let end = first.checked_add(len as u64).filter(|end| *end <= count);
    let range = end.and_then(|end| Some(usize::try_from(first).ok()?..usize::try_from(end).ok()?));
    range.ok_or_else(|| {
        let what = format!("{len} particles after {first} do not exist, there are {count}");
        FrameError::io(path, io::Error::new(io::ErrorKind::InvalidInput, what))
    })
}
