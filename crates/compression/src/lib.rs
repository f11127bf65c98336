//! Compressed files: which compression a file has, by its content, and its content without it.
//!
//! ```text
//! file.csv.gz -> [compression] -> bytes of file.csv -> readers, formats
//! ```
//!
//! `decompressor` reads a file from front to back, `member` decodes one stream of it (`lz4`, `scf` with `blosc`, and
//! `zip` for an archive of one file), `length` estimates the decompressed length, `whole` reads all of a file, and
//! `regular` detects changes of it. NPZ files are archives of arrays and not compressed in this sense. Which format the
//! content has is left to others: `spherule-readers` and `spherule-formats` take the bytes.
//!
//! ```
//! use std::io::Write;
//!
//! use flate2::Compression;
//! use flate2::write::GzEncoder;
//! use spherule_compression::{is_compressed, read_whole, strip_extension};
//! use spherule_frame::MemoryBudget;
//!
//! let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
//! gzip.write_all(b"x,y,z\n0,0,1\n")?;
//! let bytes = gzip.finish()?;
//! assert!(is_compressed(&bytes));
//! assert_eq!(strip_extension("drop.csv.gz"), "drop.csv");
//!
//! let path = std::env::temp_dir().join(format!("{}.csv.gz", std::process::id()));
//! std::fs::write(&path, bytes)?;
//! assert_eq!(read_whole(&path, MemoryBudget::UNLIMITED)?, b"x,y,z\n0,0,1\n");
//! std::fs::remove_file(&path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]

mod blosc;
mod decompressor;
mod length;
mod lz4;
mod member;
pub mod regular;
mod scf;
#[cfg(test)]
mod tests;
mod whole;
mod xz;
mod zip;

use std::io::{BufRead, Cursor, Seek};

pub use decompressor::{ByteStream, Decompressor, StreamError};
pub use length::unpacked_len;
pub use whole::{decompressor, read_whole};
pub use xz::decoder_len as xz_decoder_len;

use spherule_frame::ParseError;
use zip::ZipContent;

/// Extensions of compressed files, in lower case.
const EXTENSIONS: [&str; 7] = [".gz", ".zst", ".bz2", ".xz", ".lz4", ".sc", ".zip"];

/// `name` without the extension of a compression; `name` must be in lower case.
pub fn strip_extension(name: &str) -> &str {
    let mut stripped = EXTENSIONS.iter().filter_map(|e| name.strip_suffix(e));
    stripped.next().unwrap_or(name)
}

/// Whether `bytes`, the whole content of a file, are compressed.
pub fn is_compressed(bytes: &[u8]) -> bool {
    let found = Compression::detect(&mut Cursor::new(bytes));
    // An archive that is refused is compressed, too
    !matches!(found, Ok(None))
}

/// How a file is compressed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Compression {
    /// One of the formats that consist of streams after one another.
    Streams(StreamFormat),
    /// A zip archive of one file.
    Zip(zip::ZippedFile),
}

/// A format of compressed streams. A file may have several streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamFormat {
    /// RFC 1952.
    Gzip,
    /// RFC 8878.
    Zstd,
    /// The format of the program `bzip2`.
    Bzip2,
    /// "The .xz File Format".
    Xz,
    /// "LZ4 Frame Format".
    Lz4,
    /// Houdini's "seekable compressed format".
    Scf,
}

impl Compression {
    /// The compression of the file in `reader`, which is at its beginning and stays there; `None` for others.
    ///
    /// # Errors
    /// [`StreamError`] if it cannot be read; [`ParseError::Unsupported`] for an archive of several files.
    pub fn detect<R: BufRead + Seek>(reader: &mut R) -> Result<Option<Self>, StreamError> {
        let head = reader.fill_buf().map_err(StreamError::Io)?;
        if let Some(format) = StreamFormat::of(head) {
            return Ok(Some(Self::Streams(format)));
        }
        if !zip::has_signature(head) {
            return Ok(None);
        }
        let content = zip::content(reader);
        reader.rewind().map_err(StreamError::Io)?;
        match content {
            ZipContent::File(file) => Ok(Some(Self::Zip(file))),
            ZipContent::Several(names) => {
                let what = format!(
                    "a zip archive of several files ({names}), which is not read; unpack it and give the files"
                );
                Err(ParseError::unsupported(what).into())
            }
            ZipContent::Other => Ok(None),
        }
    }

    /// Name for messages.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Streams(format) => format.name(),
            Self::Zip(_) => "zip",
        }
    }
}

impl StreamFormat {
    const ALL: [Self; 6] = [Self::Gzip, Self::Zstd, Self::Bzip2, Self::Xz, Self::Lz4, Self::Scf];

    /// The format of a file that begins with `head`.
    pub fn of(head: &[u8]) -> Option<Self> {
        if let Some(rest) = after_skippable(head) {
            // Such frames may come before others in both formats that have them
            let others = [Self::Zstd, Self::Lz4];
            return others.into_iter().find(|format| format.begins(rest));
        }
        Self::ALL.into_iter().find(|format| format.begins(head))
    }

    /// Name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gzip => "gzip",
            Self::Zstd => "zstd",
            Self::Bzip2 => "bzip2",
            Self::Xz => "xz",
            Self::Lz4 => "LZ4",
            Self::Scf => "blosc",
        }
    }

    /// Whether a stream begins with `bytes`. At least four bytes are checked, so that raw floats do not look like one.
    fn begins(self, bytes: &[u8]) -> bool {
        match self {
            // Magic, method deflate and reserved flags
            Self::Gzip => {
                bytes.starts_with(&[0x1f, 0x8b, 8])
                    && bytes.get(3).is_none_or(|flags| flags & 0xe0 == 0)
            }
            // Magic, level, and the magic of a block or of the end
            Self::Bzip2 => {
                let blocks = [*b"\x31\x41\x59\x26\x53\x59", *b"\x17\x72\x45\x38\x50\x90"];
                bytes.starts_with(b"BZh")
                    && bytes.get(3).is_some_and(|level| (b'1'..=b'9').contains(level))
                    && blocks.iter().any(|block| bytes.get(4..10) == Some(block))
            }
            Self::Zstd | Self::Xz | Self::Lz4 | Self::Scf => bytes.starts_with(self.magic()),
        }
    }

    /// Whether `bytes`, all that is left of a file or its next ones, may begin a stream. A stream that is cut short
    /// is one.
    fn may_begin(self, bytes: &[u8]) -> bool {
        let magic = self.magic();
        let len = bytes.len().min(magic.len());
        len > 0 && bytes.get(..len) == magic.get(..len)
    }

    const fn magic(self) -> &'static [u8] {
        match self {
            Self::Gzip => b"\x1f\x8b",
            Self::Zstd => b"\x28\xb5\x2f\xfd",
            Self::Bzip2 => b"BZh",
            Self::Xz => b"\xfd7zXZ\0",
            Self::Lz4 => b"\x04\x22\x4d\x18",
            Self::Scf => scf::MAGIC,
        }
    }

    /// Whether frames may be among the streams that decoders skip.
    const fn has_skippable_frames(self) -> bool {
        matches!(self, Self::Zstd | Self::Lz4)
    }
}

/// Bytes of the header of a skippable frame: magic and length.
const SKIPPABLE_HEADER: usize = 8;

/// The length of the content of a skippable frame (zstd and LZ4 have the same) that begins with `bytes`.
fn skippable_len(bytes: &[u8]) -> Option<u32> {
    let (magic, rest) = bytes.split_first_chunk::<4>()?;
    let is_skippable = u32::from_le_bytes(*magic) & !0xf == 0x184d_2a50;
    let len = rest.first_chunk::<4>().filter(|_| is_skippable)?;
    Some(u32::from_le_bytes(*len))
}

/// What follows the skippable frame that `head` begins with; `None` if there is none, or nothing of the rest in `head`.
fn after_skippable(head: &[u8]) -> Option<&[u8]> {
    let len = usize::try_from(skippable_len(head)?).ok()?;
    head.get(SKIPPABLE_HEADER.checked_add(len)?..)
}
