//! Files of other programs as sources of particles that need not fit into memory.
//!
//! The reader of the format decides which files qualify: their numbers must have fixed strides in the file itself, or
//! the reader must be able to decode ranges of them.
//! Text, compressed files and files of several steps are read into memory by [`crate::FrameFile`] instead.

use std::path::Path;
use std::sync::Arc;

use super::ParticleSource;
use crate::native::MappedFile;
use crate::open::SiblingFiles;
use crate::read::columns::ParticleLayout;
use crate::{FrameError, ParseError};
use spherule_readers::compression::is_compressed;
use spherule_readers::regular::regular_len;
use spherule_readers::shared::SharedBytes;

mod columns;
mod ranges;

use columns::ColumnSource;
use ranges::RangeSource;

/// The particles of the mapped file at `path`. `None` if they can only be read as a whole: then
/// [`crate::FrameFile`] reads them, or returns the error.
///
/// # Errors
/// As [`crate::FrameFile::open`] and [`crate::FrameFile::read`] of the same file.
pub fn open_source(path: &Path) -> Result<Option<Box<dyn ParticleSource>>, FrameError> {
    regular_len(path)?;
    let file = MappedFile::open(path)?;
    if is_compressed(file.bytes()) {
        return Ok(None);
    }
    let layout = layout_of(file.bytes(), path);
    // Missing bytes read as zeros; report the changed file, not the zeros.
    file.check()?;
    if let Some(layout) = layout.map_err(|e| e.in_file(path))? {
        return Ok(Some(Box::new(ColumnSource::new(file, layout))));
    }
    let file = Arc::new(file);
    let siblings = SiblingFiles::of(path);
    let bytes = siblings.around(SharedBytes::new(file.clone()));
    let ranges = crate::detect::detect_format(&bytes, path)
        .and_then(|format| format.reader().ranges(&bytes));
    file.check()?;
    siblings.check()?;
    let ranges = ranges.map_err(|e| e.in_file(path))?;
    Ok(ranges.map(|ranges| {
        Box::new(RangeSource::new(file, siblings, ranges)) as Box<dyn ParticleSource>
    }))
}

/// The layout of the particles in `bytes`, the contents of `path`; `None` if some numbers have no fixed stride.
fn layout_of(bytes: &[u8], path: &Path) -> Result<Option<ParticleLayout>, ParseError> {
    let layout = crate::detect::detect_format(bytes, path)?.reader().layout(bytes)?;
    if let Some(layout) = &layout {
        layout.check(bytes.len())?;
    }
    Ok(layout)
}

#[cfg(test)]
mod tests;
