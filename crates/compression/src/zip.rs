//! Zip archives of one file.

use std::borrow::Cow;
use std::io::{self, BufRead, Read, Seek, SeekFrom, Take};

use flate2::Crc;
use flate2::bufread::DeflateDecoder;
use zip::{CompressionMethod, ZipArchive};

/// Names of files that a message lists.
const SHOWN: usize = 5;

/// The only file of an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ZippedFile {
    /// Where its compressed bytes begin.
    start: u64,
    stored_len: u64,
    is_deflated: bool,
    len: u64,
    crc: u32,
}

/// What an archive is.
pub(super) enum ZipContent {
    /// One file in a compression that is read.
    File(ZippedFile),
    /// Several files: their names.
    Several(String),
    /// Arrays of numpy, a damaged archive, or something else that is left to the readers.
    Other,
}

/// Whether `head` begins like a zip archive that is not empty.
pub(super) fn has_signature(head: &[u8]) -> bool {
    head.starts_with(b"PK\x03\x04")
}

/// What the archive in `reader` has.
pub(super) fn content<R: Read + Seek>(reader: &mut R) -> ZipContent {
    let Ok(mut archive) = ZipArchive::new(reader) else {
        return ZipContent::Other;
    };
    // Directories, and what macOS adds beside files, are no files of the user
    let is_file = |name: &String| !name.ends_with('/') && !name.starts_with("__MACOSX/");
    let mut names: Vec<String> =
        archive.file_names().filter_map(Result::ok).map(Cow::into_owned).filter(is_file).collect();
    let is_other = |name: &String| {
        let name = name.to_ascii_lowercase();
        let others = [".npy", ".usd", ".usda", ".usdc"];
        others.iter().any(|end| name.ends_with(end))
    };
    if names.iter().any(is_other) {
        return ZipContent::Other;
    }
    // Of several files of one name, the archive has one
    if archive.has_duplicate_names() {
        names.push("a name twice".to_owned());
    }
    names.sort_unstable();
    let only = match names.as_slice() {
        [] => return ZipContent::Other,
        [only] => only.clone(),
        _ => {
            let more = names.len().saturating_sub(SHOWN);
            let shown = names.get(..SHOWN).unwrap_or(&names).join(", ");
            return ZipContent::Several(match more {
                0 => shown,
                _ => format!("{shown} and {more} more"),
            });
        }
    };
    let Some(index) = archive.index_for_name(&only) else {
        return ZipContent::Other;
    };
    let Ok(file) = archive.by_index_raw(index) else {
        return ZipContent::Other;
    };
    let is_deflated = match file.compression() {
        CompressionMethod::Stored => false,
        CompressionMethod::Deflated => true,
        _ => return ZipContent::Other,
    };
    match file.data_start() {
        Some(start) if !file.encrypted() => ZipContent::File(ZippedFile {
            start,
            stored_len: file.compressed_size(),
            is_deflated,
            len: file.size(),
            crc: file.crc32(),
        }),
        _ => ZipContent::Other,
    }
}

/// Reads the content of the only file of an archive. At its end, its length and checksum have been compared.
pub(super) struct ZipReader<R> {
    source: ZipSource<R>,
    file: ZippedFile,
    crc: Crc,
}

enum ZipSource<R> {
    Stored(Take<R>),
    Deflated(DeflateDecoder<Take<R>>),
}

impl<R: BufRead + Seek> ZipReader<R> {
    /// Reads `file` of the archive in `reader`.
    ///
    /// # Errors
    /// [`io::Error`] if its place cannot be reached.
    pub(super) fn new(mut reader: R, file: ZippedFile) -> io::Result<Self> {
        reader.seek(SeekFrom::Start(file.start))?;
        let stored = reader.take(file.stored_len);
        let source = if file.is_deflated {
            ZipSource::Deflated(DeflateDecoder::new(stored))
        } else {
            ZipSource::Stored(stored)
        };
        let crc = Crc::new();
        Ok(Self { source, file, crc })
    }
}

impl<R> ZipReader<R> {
    /// The length of the content that the archive states.
    pub(super) const fn stated_len(&self) -> u64 {
        self.file.len
    }
}

impl<R: BufRead> Read for ZipReader<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let len = match &mut self.source {
            ZipSource::Stored(source) => source.read(to)?,
            ZipSource::Deflated(source) => source.read(to)?,
        };
        self.crc.update(to.get(..len).unwrap_or_default());
        if len == 0 && !to.is_empty() {
            // The checksum counts its bytes modulo 2^32
            let has_len = u64::from(self.crc.amount()) == self.file.len & 0xffff_ffff;
            if !has_len || self.crc.sum() != self.file.crc {
                let what = "length or checksum of the file in it differ";
                return Err(io::Error::new(io::ErrorKind::InvalidData, what));
            }
        }
        Ok(len)
    }
}
