//! Decoders of one compressed stream, with one interface.

use std::error::Error;
use std::io::{self, BufRead, Read, Seek};

use bzip2::bufread::BzDecoder;
use flate2::bufread::GzDecoder;
use lzma_rust2::XzReader;
use ruzstd::decoding::errors::{FrameDecoderError, FrameHeaderError};
use ruzstd::decoding::{FrameDecoder, StreamingDecoder};

use super::lz4::{self, Lz4Frame};
use super::scf::ScfReader;
use super::zip::{ZipReader, ZippedFile};
use super::{StreamFormat, xz};
use spherule_frame::MemoryBudget;

/// Most bytes that a decoder may hold beside its output, whatever the budget: the window of zstd's `--long` has
/// 128 MiB, the largest preset of xz 64 MiB.
const MAX_DECODER: u64 = 130 << 20;

/// Bytes that a decoder of bzip2 holds.
const BZIP2_DECODER: u64 = 4 << 20;

/// A stream that is being decoded.
pub(super) enum StreamDecoder<R: BufRead> {
    Gzip(GzDecoder<R>),
    Zstd(Box<StreamingDecoder<R, FrameDecoder>>),
    Bzip2(Box<BzDecoder<R>>),
    Xz(Box<XzReader<R>>),
    Lz4(Box<Lz4Frame<R>>),
    Scf(Box<ScfReader<R>>),
    Zip(Box<ZipReader<R>>),
}

impl<R: BufRead + Seek> StreamDecoder<R> {
    /// Decodes the only file of a zip archive.
    pub(super) fn zip(reader: R, file: ZippedFile) -> io::Result<Self> {
        Ok(Self::Zip(Box::new(ZipReader::new(reader, file)?)))
    }
}

impl<R: BufRead> StreamDecoder<R> {
    /// Decodes the stream at which `reader` is, in `budget`. Also returns the bytes that the decoder holds beside its
    /// output; for gzip, which holds little, 0.
    ///
    /// # Errors
    /// [`io::Error`] for a damaged header, and with [`io::ErrorKind::OutOfMemory`] if `budget` is too small.
    pub(super) fn new(
        format: StreamFormat,
        mut reader: R,
        budget: MemoryBudget,
    ) -> io::Result<(Self, u64)> {
        let most = budget.bytes().min(MAX_DECODER);
        Ok(match format {
            StreamFormat::Gzip => (Self::Gzip(GzDecoder::new(reader)), 0),
            StreamFormat::Zstd => {
                let window = zstd_window(reader.fill_buf()?);
                let decoder = StreamingDecoder::new_with_max_window_size(reader, most)
                    .map_err(|error| zstd_error(error, most))?;
                let held = window.unwrap_or(decoder.decoder.content_size());
                (Self::Zstd(Box::new(decoder)), held)
            }
            StreamFormat::Bzip2 => {
                check(BZIP2_DECODER, most)?;
                (Self::Bzip2(Box::new(BzDecoder::new(reader))), BZIP2_DECODER)
            }
            StreamFormat::Xz => {
                let held = xz::decoder_len(reader.fill_buf()?).unwrap_or(0);
                check(held, most)?;
                let kib = u32::try_from(most >> 10).unwrap_or(u32::MAX);
                let decoder = XzReader::new_mem_limit(reader, false, kib);
                (Self::Xz(Box::new(decoder)), held)
            }
            StreamFormat::Lz4 => {
                check(lz4::DECODER_LEN, most)?;
                let decoder = Lz4Frame::new(reader)?;
                (Self::Lz4(Box::new(decoder)), lz4::DECODER_LEN)
            }
            StreamFormat::Scf => {
                let decoder = ScfReader::new(reader, most)?;
                let held = decoder.decoder_len();
                (Self::Scf(Box::new(decoder)), held)
            }
        })
    }

    /// The reader behind the stream, which has been read to its end; `None` for a zip archive, which has only one.
    pub(super) fn into_inner(self) -> Option<R> {
        match self {
            Self::Gzip(decoder) => Some(decoder.into_inner()),
            Self::Zstd(decoder) => Some(decoder.into_inner()),
            Self::Bzip2(decoder) => Some(decoder.into_inner()),
            Self::Xz(decoder) => Some(decoder.into_inner()),
            Self::Lz4(decoder) => Some(decoder.into_inner()),
            Self::Scf(decoder) => Some(decoder.into_inner()),
            Self::Zip(_) => None,
        }
    }

    /// The length of the content if the header of the stream states it.
    pub(super) fn stated_len(&self) -> Option<u64> {
        match self {
            Self::Zstd(decoder) => Some(decoder.decoder.content_size()).filter(|len| *len > 0),
            Self::Lz4(decoder) => decoder.stated_len(),
            Self::Zip(decoder) => Some(decoder.stated_len()),
            Self::Gzip(_) | Self::Bzip2(_) | Self::Xz(_) | Self::Scf(_) => None,
        }
    }

    /// Checks what the decoder leaves to its caller at the end of the stream.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidData`].
    pub(super) fn check_end(&self) -> io::Result<()> {
        let Self::Zstd(decoder) = self else {
            return Ok(());
        };
        let stated = decoder.decoder.get_checksum_from_data();
        if stated.is_some() && stated != decoder.decoder.get_calculated_checksum() {
            let what = "the checksum differs";
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(())
    }
}

impl<R: BufRead> Read for StreamDecoder<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Gzip(decoder) => decoder.read(to),
            Self::Zstd(decoder) => decoder.read(to),
            Self::Bzip2(decoder) => decoder.read(to),
            Self::Xz(decoder) => decoder.read(to),
            Self::Lz4(decoder) => decoder.read(to),
            Self::Scf(decoder) => decoder.read(to),
            Self::Zip(decoder) => decoder.read(to),
        }
    }
}

fn check(need: u64, most: u64) -> io::Result<()> {
    if need <= most { Ok(()) } else { Err(io::ErrorKind::OutOfMemory.into()) }
}

/// The window of the zstd frame that `head` begins with; `None` if the frame has none but holds its content as a whole.
fn zstd_window(head: &[u8]) -> Option<u64> {
    const IS_SINGLE_SEGMENT: u8 = 0x20;
    let [_, _, _, _, descriptor, window, ..] = *head else {
        return None;
    };
    // Powers of two from 1 KiB, in eighths
    let base = 1_u64 << (10 + (window >> 3));
    (descriptor & IS_SINGLE_SEGMENT == 0).then_some(base + base / 8 * u64::from(window & 7))
}

/// The error of a zstd frame that cannot be decoded in `most` bytes.
fn zstd_error(error: FrameDecoderError, most: u64) -> io::Error {
    let is_window = match &error {
        FrameDecoderError::WindowSizeTooBig { requested, .. } => *requested > most,
        FrameDecoderError::FrameHeaderError(FrameHeaderError::WindowTooBig { .. }) => true,
        _ => false,
    };
    if is_window { io::ErrorKind::OutOfMemory.into() } else { io::Error::other(error) }
}

/// Whether the file ended within the stream.
pub(super) fn is_early_end(error: &io::Error) -> bool {
    let mut cause: Option<&(dyn Error + 'static)> = Some(error);
    while let Some(current) = cause {
        if let Some(io) = current.downcast_ref::<io::Error>() {
            if io.kind() == io::ErrorKind::UnexpectedEof {
                return true;
            }
            cause = io.get_ref().map(|inner| inner as &(dyn Error + 'static));
        } else {
            cause = current.source();
        }
    }
    false
}
