//! Packs a block of rows: converts it to the bytes of the file.
//!
//! For ZIP, [`Differences`] of the bytes of the samples are compressed by [`Deflater`]. Every block is a new stream, so
//! its bytes depend only on the samples and the layout.

use exr::math::Vec2;
use exr::prelude::IntegerBounds;

use super::deflate::{Deflater, Piece, WINDOW};
use super::differences::Differences;
use super::layout::{ExrBlock, ExrLayout, ExrPart};
use super::lines::LineBuffer;
use super::planes::SampleKind;
use super::{Compression, OutputError};
use crate::math::Supported;
use crate::render::FilmRows;

/// A block in the form in which it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedBlock {
    /// Index of its part in the layout.
    pub part: usize,
    /// First row.
    pub y: u32,
    /// The compressed bytes, or the uncompressed bytes if compression does not shorten them.
    pub bytes: Vec<u8>,
    /// Number of values of `R G B A` that were clamped; see [`super::EncodedExr::clamped`].
    pub clamped: u64,
}

/// Memory for packing, which is reused for the next block.
#[derive(Debug, Default)]
pub struct PackBuffers {
    line: LineBuffer,
    differences: Vec<u8>,
    deflater: Deflater,
}

impl PackBuffers {
    /// Size of the buffers in bytes, after they have packed blocks with `samples` bytes of samples to `packed` bytes.
    pub fn predicted_bytes(samples: u64, packed: u64) -> u64 {
        samples + Deflater::predicted_bytes(samples, packed)
    }
}

/// Packs `block`, one of [`ExrLayout::blocks`].
///
/// # Errors
/// If the codec of the crate `exr` fails.
///
/// # Panics
/// If the film of `block` lacks planes of `layout`.
pub fn pack_block(
    block: &ExrBlock<'_>,
    layout: &ExrLayout,
    buffers: &mut PackBuffers,
) -> Result<PackedBlock, OutputError> {
    let (rows, layout) = (&block.rows, &layout.parts[block.part]);
    buffers.line.clamped = 0;
    let bytes = match layout.compression {
        Compression::None => plain(rows, layout, &mut buffers.line),
        Compression::Zip | Compression::Zips => match zip(rows, layout, buffers) {
            Some(stream) => stream.to_vec(),
            // Store the block uncompressed if compression does not shorten it; readers recognise this by its length
            None => {
                buffers.line.clamped = 0;
                plain(rows, layout, &mut buffers.line)
            }
        },
        Compression::Rle | Compression::Piz => compress_with_exr(rows, layout, &mut buffers.line)?,
    };
    Ok(PackedBlock { part: block.part, y: rows.top, bytes, clamped: buffers.line.clamped })
}

/// Calls `visit` with the samples of `rows`, line by line in the order of the file. Its arguments are the offset of the
/// line in the block, the bytes of the line, and the number of bytes per sample.
fn for_each_line(
    rows: &FilmRows,
    layout: &ExrPart,
    buffer: &mut LineBuffer,
    mut visit: impl FnMut(usize, &[u8], usize),
) {
    let mut offset = 0;
    for row in 0..rows.height as usize {
        for channel in &layout.channels {
            let line = buffer.line(rows, row, channel.source);
            visit(offset, line, channel.sample_type().bytes_per_sample());
            offset += line.len();
        }
    }
}

/// The uncompressed samples, little-endian.
fn plain(rows: &FilmRows, layout: &ExrPart, buffer: &mut LineBuffer) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(layout.bytes(rows.height));
    for_each_line(rows, layout, buffer, |_, line, _| {
        bytes.extend_from_slice(line);
    });
    bytes
}

/// Compresses a block with the crate `exr`, which expects samples in the byte order of the machine.
fn compress_with_exr(
    rows: &FilmRows,
    layout: &ExrPart,
    buffer: &mut LineBuffer,
) -> Result<Vec<u8>, OutputError> {
    let mut bytes = Vec::with_capacity(layout.bytes(rows.height));
    for_each_line(rows, layout, buffer, |offset, line, sample_len| {
        bytes.extend_from_slice(line);
        if cfg!(target_endian = "big") {
            bytes[offset..].chunks_exact_mut(sample_len).for_each(<[u8]>::reverse);
        }
    });
    let top = i32::try_from(rows.top).expect("images have at most 65536 rows");
    let size = Vec2(rows.width as usize, rows.height as usize);
    let left = layout.header.own_attributes.layer_position.x();
    let section = IntegerBounds::new(Vec2(left, layout.top() + top), size);
    let codec = layout.compression.codec();
    let packed = codec.compress_image_section_to_le(&layout.header, bytes, section);
    packed.map_err(OutputError::Exr)
}

/// The zlib stream of `rows`, or None if it is no shorter than the samples.
fn zip<'b>(rows: &FilmRows, layout: &ExrPart, buffers: &'b mut PackBuffers) -> Option<&'b [u8]> {
    let PackBuffers { line, differences, deflater } = buffers;
    differences.resize(layout.bytes(rows.height), 0);
    let mut block = Differences::new(differences, Supported::default());
    for_each_line(rows, layout, line, |_, line, _| block.push(line));
    block.finish();
    deflater.compress(differences, layout.pieces(rows.height))
}

impl ExrPart {
    /// The pieces of the differences of a block of `rows` rows: stretches of similar channels, first of the bytes at even
    /// positions, then of those at odd positions.
    fn pieces(&self, rows: u32) -> impl Iterator<Item = Piece> {
        let width = self.header.layer_size.x();
        // A particle mostly has the same values in the row above. They are half the bytes of a row away, because even
        // and odd bytes are separate.
        let is_row_above_in_reach = rows > 1 && self.bytes(1) / 2 <= WINDOW;
        // Group adjacent channels of the same kind
        let groups: Vec<(SampleKind, usize)> = self
            .channels
            .chunk_by(|a, b| a.kind() == b.kind())
            .map(|group| {
                let bytes = group.iter().map(|channel| channel.sample_type().bytes_per_sample());
                (group[0].kind(), bytes.sum::<usize>() * width / 2)
            })
            .collect();
        // One piece for each group in each row
        let pieces = move |is_odd: bool| {
            let row = groups.clone().into_iter().map(move |(kind, length)| Piece {
                length,
                is_searched: match kind {
                    SampleKind::Color | SampleKind::Surface => false,
                    // Exponents hardly change, so the differences to and from them repeat in pairs
                    SampleKind::Position => is_odd,
                    SampleKind::Particle => is_row_above_in_reach,
                },
            });
            std::iter::repeat_n(row, rows as usize).flatten()
        };
        pieces(false).chain(pieces(true))
    }
}

#[cfg(test)]
#[path = "pack_tests.rs"]
mod tests;
