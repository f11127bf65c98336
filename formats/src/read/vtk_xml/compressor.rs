//! The three compressors of VTK, one block at a time, into a buffer whose size the file states.

use std::io::Read;

use flate2::{Decompress, FlushDecompress, Status};
use lzma_rust2::XzReader;

use super::document::short;
use crate::ParseError;

/// LZMA decoders allocate the dictionary that the block asks for; the largest preset of xz (64 MiB)
/// stays below this.
const XZ_MEMORY_KIB: u32 = 80 * 1024;

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

    /// Decompresses one block that must fill `output` exactly.
    pub(super) fn decompress(self, block: &[u8], output: &mut [u8]) -> Result<(), String> {
        let wanted = output.len();
        let written = match self {
            Self::Zlib => {
                let mut zlib = Decompress::new(true);
                match zlib.decompress(block, output, FlushDecompress::Finish) {
                    Ok(Status::StreamEnd) => {
                        usize::try_from(zlib.total_out()).unwrap_or(usize::MAX)
                    }
                    Ok(_) => {
                        return Err(format!("zlib stream is no {wanted} bytes or is cut short"));
                    }
                    Err(error) => return Err(format!("zlib: {error}")),
                }
            }
            Self::Lz4 => lz4_flex::block::decompress_into(block, output)
                .map_err(|error| format!("lz4: {error}"))?,
            Self::Xz => {
                let mut xz = XzReader::new_mem_limit(block, false, XZ_MEMORY_KIB);
                xz.read_exact(output)
                    .map_err(|error| format!("xz: {error}"))?;
                // Reading on to the end also verifies the checksum.
                let beyond = xz.read(&mut [0]).map_err(|error| format!("xz: {error}"))?;
                wanted + beyond
            }
        };
        if written == wanted {
            Ok(())
        } else {
            Err(format!(
                "it holds {written} bytes or more, its header says {wanted}"
            ))
        }
    }
}
