//! Writes a file with scanlines: magic number, version, the header of each part, offsets of the blocks, blocks.

use std::io::{Seek, SeekFrom, Write};

use exr::error::Error;
use exr::meta::attribute;
use exr::prelude::{AttributeValue, Text};

use super::layout::{ExrLayout, ExrPart};
use super::pack::PackedBlock;
use super::{OutputError, TextAttribute};

/// First bytes of every file.
const MAGIC: u32 = 20_000_630;
/// Version of the format, without flags.
const VERSION: u32 = 2;
/// Flag of a file with names of more than 31 bytes.
const LONG_NAMES: u32 = 1 << 10;

/// Flag of a file with several parts.
const MULTI_PART: u32 = 1 << 12;

/// A file that is being written, block by block.
pub(super) struct ScanLineFile<'a, W> {
    file: &'a mut W,
    /// Place of the offsets, bytes.
    offsets_at: u64,
    /// Place of the next block, bytes.
    end: u64,
    parts: Vec<PartBlocks>,
}

/// The blocks of a part so far.
struct PartBlocks {
    /// Their places.
    offsets: Vec<u64>,
    /// Number of blocks of the whole part.
    count: usize,
    /// First row of the part.
    top: i32,
}

impl<'a, W: Write + Seek> ScanLineFile<'a, W> {
    /// Writes everything before the blocks, with zeros for the offsets.
    pub(super) fn start(file: &'a mut W, layout: &ExrLayout) -> Result<Self, OutputError> {
        let mut start = headers(layout).map_err(OutputError::Exr)?;
        let blocks = |part: &ExrPart| PartBlocks {
            offsets: Vec::with_capacity(part.header.chunk_count),
            count: part.header.chunk_count,
            top: part.top(),
        };
        let parts: Vec<PartBlocks> = layout.parts.iter().map(blocks).collect();
        let count: usize = parts.iter().map(|part| part.count).sum();
        let offsets_at = start.len() as u64;
        start.resize(start.len() + 8 * count, 0);
        file.write_all(&start).map_err(io_error)?;
        Ok(Self { file, offsets_at, end: start.len() as u64, parts })
    }

    /// Writes the next block of a part.
    pub(super) fn write(&mut self, block: PackedBlock) -> Result<(), OutputError> {
        let has_parts = self.parts.len() > 1;
        let found = self.parts.get_mut(block.part);
        let part = found
            .filter(|part| part.offsets.len() < part.count)
            .ok_or_else(|| invalid("there are more blocks than in the layout"))?;
        part.offsets.push(self.end);
        // In a file with several parts, a block begins with the number of its part
        let long = |_| invalid("a block is too long");
        let number = i32::try_from(block.part).map_err(long)?;
        let row = part.top + i32::try_from(block.y).map_err(long)?;
        let len = i32::try_from(block.bytes.len()).map_err(long)?;
        let numbers = [number, row, len].map(i32::to_le_bytes);
        let start = numbers[usize::from(!has_parts)..].concat();
        self.file.write_all(&start).map_err(io_error)?;
        self.file.write_all(&block.bytes).map_err(io_error)?;
        self.end += (start.len() + block.bytes.len()) as u64;
        Ok(())
    }

    /// Writes the offsets after the last block.
    pub(super) fn finish(self) -> Result<(), OutputError> {
        let is_complete = |part: &PartBlocks| part.offsets.len() == part.count;
        if !self.parts.iter().all(is_complete) {
            return Err(invalid("some blocks are missing"));
        }
        let offsets: Vec<u8> = self
            .parts
            .iter()
            .flat_map(|part| &part.offsets)
            .flat_map(|offset| offset.to_le_bytes())
            .collect();
        let to = SeekFrom::Start(self.offsets_at);
        self.file.seek(to).map_err(io_error)?;
        self.file.write_all(&offsets).map_err(io_error)?;
        self.file.flush().map_err(io_error)
    }
}

/// The bytes before the offsets.
fn headers(layout: &ExrLayout) -> Result<Vec<u8>, Error> {
    let has_parts = layout.parts.len() > 1;
    let mut has_long_names = false;
    for part in &layout.parts {
        part.header.validate(has_parts, &mut has_long_names, true)?;
    }
    let mut version = VERSION;
    for (flag, is_set) in [(LONG_NAMES, has_long_names), (MULTI_PART, has_parts)] {
        version |= if is_set { flag } else { 0 };
    }
    let mut bytes = [MAGIC.to_le_bytes(), version.to_le_bytes()].concat();
    for part in &layout.parts {
        part.header.write(&mut bytes)?;
        // A zero ends a header; further attributes come before it
        let end = bytes.pop();
        for TextAttribute { name, text } in &part.texts {
            let value = AttributeValue::Text(Text::from_slice_unchecked(text.as_bytes()));
            attribute::write(name.as_bytes(), &value, &mut bytes)?;
        }
        bytes.extend(end);
    }
    // An empty header ends the list of several headers
    if has_parts {
        bytes.push(0);
    }
    Ok(bytes)
}

fn io_error(error: std::io::Error) -> OutputError {
    OutputError::Exr(Error::Io(error))
}

fn invalid(what: &'static str) -> OutputError {
    OutputError::Exr(Error::Invalid(what.into()))
}
