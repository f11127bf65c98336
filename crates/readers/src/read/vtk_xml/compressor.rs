//! The three compressors of VTK, one block at a time, into a buffer whose size the file states.

use std::io::{self, Read};

use flate2::{Decompress, FlushDecompress, Status};
use lzma_rust2::XzReader;

use super::short;
use crate::compression::xz_decoder_len;
use spherule_frame::ParseError;

/// Why a block cannot be decompressed.
#[derive(Debug, thiserror::Error)]
pub(super) enum DecompressError {
    #[error("zlib: {0}")]
    Zlib(#[from] flate2::DecompressError),
    #[error("zlib stream is not {expected} bytes or is cut short")]
    ZlibLength { expected: usize },
    #[error("lz4: {0}")]
    Lz4(#[from] lz4_flex::block::DecompressError),
    #[error("xz: {0}")]
    Xz(#[from] io::Error),
    #[error("it holds {written} bytes or more, but its header has {expected}")]
    Length { written: usize, expected: usize },
}

/// How blocks are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compressor {
    /// A zlib stream (with its header, not gzip).
    Zlib,
    /// A bare LZ4 block.
    Lz4,
    /// An .xz stream.
    Xz,
}

impl Compressor {
    /// Bytes that no block may take beside its output: LZMA decoders allocate the dictionary that the block asks for;
    /// the largest preset of xz (64 MiB) stays below this.
    pub(super) const MAX_MEMORY: u64 = 80 << 20;

    /// The compressor that VTK calls `name`.
    ///
    /// # Errors
    /// Unsupported, naming it, if it is none of the three.
    pub(super) fn from_name(name: &str) -> Result<Self, ParseError> {
        match name {
            "vtkZLibDataCompressor" => Ok(Self::Zlib),
            "vtkLZ4DataCompressor" => Ok(Self::Lz4),
            "vtkLZMADataCompressor" => Ok(Self::Xz),
            _ => Err(ParseError::unsupported(format!(
                "compressor `{}` is not known; write with zlib, LZ4, LZMA or none",
                short(name)
            ))),
        }
    }

    /// The most bytes that `compressed` bytes can become: a block that claims more lies.
    ///
    /// Deflate cannot do better than 1032 : 1 and LZ4 than 255 : 1; LZMA reaches about 7000 : 1.
    pub(super) const fn most_output(self, compressed: usize) -> usize {
        let ratio = match self {
            Self::Zlib => 1032,
            Self::Lz4 => 255,
            Self::Xz => 16_384,
        };
        compressed.saturating_mul(ratio)
    }

    /// Bytes that decompressing `block` takes beside its output.
    pub(super) fn memory(self, block: &[u8]) -> u64 {
        match self {
            Self::Zlib | Self::Lz4 => 0,
            Self::Xz => xz_decoder_len(block).unwrap_or(0),
        }
    }

    /// Decompresses one block that must fill `output` exactly, in no more than `memory` bytes beside it.
    pub(super) fn decompress(
        self,
        block: &[u8],
        output: &mut [u8],
        memory: u64,
    ) -> Result<(), DecompressError> {
        let expected = output.len();
        let written = match self {
            Self::Zlib => {
                let mut zlib = Decompress::new(true);
                match zlib.decompress(block, output, FlushDecompress::Finish) {
                    Ok(Status::StreamEnd) => {
                        usize::try_from(zlib.total_out()).unwrap_or(usize::MAX)
                    }
                    Ok(_) => {
                        return Err(DecompressError::ZlibLength { expected });
                    }
                    Err(error) => return Err(error.into()),
                }
            }
            Self::Lz4 => lz4_flex::block::decompress_into(block, output)?,
            Self::Xz => {
                let kib = memory.min(Self::MAX_MEMORY) >> 10;
                let kib = u32::try_from(kib).unwrap_or(u32::MAX);
                let mut xz = XzReader::new_mem_limit(block, false, kib);
                xz.read_exact(output)?;
                // Reading on to the end also verifies the checksum.
                let beyond = xz.read(&mut [0])?;
                expected + beyond
            }
        };
        if written == expected {
            Ok(())
        } else {
            Err(DecompressError::Length { written, expected })
        }
    }
}
