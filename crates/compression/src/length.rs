//! The decompressed length of a file, without decompressing all of it.

use std::cell::Cell;
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::rc::Rc;

use super::{ByteStream, Compression, Decompressor, StreamFormat};
use spherule_frame::MemoryBudget;

/// Bytes that are decompressed where no length is stated: several blocks of bzip2, or one of LZ4.
const SAMPLE: usize = 4 << 20;

/// Bytes that are read at a time for a sample, so that what was read is what was decompressed.
const SAMPLE_BUFFER: usize = 4 << 10;

/// The decompressed length of the file at `path`.
///
/// It is an estimate for compressed files. gzip states the length of its last member modulo 4 GiB (RFC 1952), zip that
/// of its file, zstd and LZ4 often that of the first frame. Of other files the beginning is decompressed and taken as
/// typical.
///
/// # Errors
/// [`io::Error`] if the file cannot be read.
pub fn unpacked_len(path: &Path) -> io::Result<u64> {
    // Opening a pipe would block until it has a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let mut file = BufReader::with_capacity(SAMPLE_BUFFER, File::open(path)?);
    let len = file.get_ref().metadata()?.len();
    // A file that cannot be decompressed fails when it is read
    match Compression::detect(&mut file).ok().flatten() {
        None => Ok(len),
        Some(Compression::Streams(StreamFormat::Gzip)) if len < 18 => Ok(len),
        Some(Compression::Streams(StreamFormat::Gzip)) => {
            let mut end = [0; 4];
            file.seek(SeekFrom::End(-4))?;
            file.read_exact(&mut end)?;
            Ok(u64::from(u32::from_le_bytes(end)).max(len))
        }
        Some(Compression::Streams(_) | Compression::Zip(_)) => {
            file.rewind()?;
            Ok(by_header_or_sample(file.into_inner(), len))
        }
    }
}

/// The length that the header of the compressed `file` of `len` bytes states, or its length if all of it is like the
/// first [`SAMPLE`] bytes of its content.
fn by_header_or_sample(file: File, len: u64) -> u64 {
    let read = Rc::new(Cell::new(0));
    let counted = CountingFile { file, read: Rc::clone(&read) };
    let reader = BufReader::with_capacity(SAMPLE_BUFFER, counted);
    let Ok(mut stream) = Decompressor::new(reader, MemoryBudget::UNLIMITED) else {
        return len;
    };
    // Frames may be short, and only the first one states its length here
    let stated = stream.stated_len().filter(|stated| *stated > SAMPLE as u64);
    if let Some(stated) = stated {
        return stated;
    }
    let mut bytes = Vec::new();
    let filled = stream.fill(&mut bytes, SAMPLE);
    let found = bytes.len() as u64;
    if !matches!(filled, Ok(SAMPLE)) {
        return found;
    }
    // zstd returns nothing before its window is full
    let decoded = u128::from(found + stream.held_back_len());
    let product = decoded * u128::from(len) / u128::from(read.get().max(1));
    u64::try_from(product).unwrap_or(u64::MAX)
}

/// A file that counts the bytes that are read from it.
struct CountingFile {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for CountingFile {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let len = self.file.read(to)?;
        self.read.set(self.read.get() + len as u64);
        Ok(len)
    }
}

impl Seek for CountingFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
