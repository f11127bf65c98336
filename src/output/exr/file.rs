//! Writes the parts of a file with scanlines: magic number, version, header, offsets of the blocks, blocks.

use std::io::{Seek, SeekFrom, Write};

use exr::error::Error;
use exr::meta::attribute;
use exr::prelude::{AttributeValue, Text};

use super::layout::ExrLayout;
use super::pack::PackedBlock;
use super::{OutputError, TextAttribute};

/// First bytes of every file.
const MAGIC: u32 = 20_000_630;
/// Version of the format, without flags.
const VERSION: u32 = 2;
/// Flag of a file with names of more than 31 bytes.
const LONG_NAMES: u32 = 1 << 10;

/// A file that is being written, block by block.
pub(super) struct ScanLineFile<'a, W> {
    file: &'a mut W,
    /// Place of the offsets, bytes.
    offsets_at: u64,
    /// Place of the next block, bytes.
    end: u64,
    /// Places of the blocks so far.
    offsets: Vec<u64>,
    /// Number of blocks of the whole file.
    count: usize,
    /// First row of the file.
    top: i32,
}

impl<'a, W: Write + Seek> ScanLineFile<'a, W> {
    /// Writes everything before the blocks, with zeros for the offsets.
    pub(super) fn start(file: &'a mut W, layout: &ExrLayout) -> Result<Self, OutputError> {
        let mut start = header(layout).map_err(OutputError::Exr)?;
        let count = layout.header.chunk_count;
        let offsets_at = start.len() as u64;
        start.resize(start.len() + 8 * count, 0);
        file.write_all(&start).map_err(io_error)?;
        Ok(Self {
            file,
            offsets_at,
            end: start.len() as u64,
            offsets: Vec::with_capacity(count),
            count,
            top: layout.top(),
        })
    }

    /// Writes the next block.
    pub(super) fn write(&mut self, block: PackedBlock) -> Result<(), OutputError> {
        if self.offsets.len() == self.count {
            return Err(invalid("there are more blocks than in the layout"));
        }
        self.offsets.push(self.end);
        let long = |_| invalid("a block is too long");
        let row = self.top + i32::try_from(block.y).map_err(long)?;
        let len = i32::try_from(block.bytes.len()).map_err(long)?;
        self.file.write_all(&row.to_le_bytes()).map_err(io_error)?;
        self.file.write_all(&len.to_le_bytes()).map_err(io_error)?;
        self.file.write_all(&block.bytes).map_err(io_error)?;
        self.end += 8 + block.bytes.len() as u64;
        Ok(())
    }

    /// Writes the offsets after the last block.
    pub(super) fn finish(self) -> Result<(), OutputError> {
        if self.offsets.len() < self.count {
            return Err(invalid("some blocks are missing"));
        }
        let offsets = self.offsets.iter().flat_map(|offset| offset.to_le_bytes());
        let offsets: Vec<u8> = offsets.collect();
        let to = SeekFrom::Start(self.offsets_at);
        self.file.seek(to).map_err(io_error)?;
        self.file.write_all(&offsets).map_err(io_error)?;
        self.file.flush().map_err(io_error)
    }
}

/// The bytes before the offsets.
fn header(layout: &ExrLayout) -> Result<Vec<u8>, Error> {
    let mut has_long_names = false;
    layout.header.validate(false, &mut has_long_names, true)?;
    let flags = if has_long_names { LONG_NAMES } else { 0 };
    let mut bytes = [MAGIC.to_le_bytes(), (VERSION | flags).to_le_bytes()].concat();
    layout.header.write(&mut bytes)?;
    // A zero ends the header; further attributes come before it
    let end = bytes.pop();
    for TextAttribute { name, text } in &layout.texts {
        let value = AttributeValue::Text(Text::from_slice_unchecked(text.as_bytes()));
        attribute::write(name.as_bytes(), &value, &mut bytes)?;
    }
    bytes.extend(end);
    Ok(bytes)
}

fn io_error(error: std::io::Error) -> OutputError {
    OutputError::Exr(Error::Io(error))
}

fn invalid(what: &'static str) -> OutputError {
    OutputError::Exr(Error::Invalid(what.into()))
}
