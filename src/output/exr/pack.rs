//! One block of rows into the bytes that its file has for it.
//!
//! ZIP is [`Differences`] of the samples' bytes, compressed by [`Deflater`]. Bytes depend on samples and layout
//! alone: every block starts a new stream.

use exr::math::Vec2;
use exr::prelude::IntegerBounds;

use super::deflate::{Deflater, Piece, WINDOW};
use super::differences::Differences;
use super::layout::ExrLayout;
use super::lines::LineBuffer;
use super::planes::PlaneKind;
use super::{Compression, OutputError};
use crate::math::Supported;
use crate::render::FilmRows;

/// A block as it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedBlock {
    /// Its first row.
    pub y: u32,
    /// Its bytes: compressed, or plain if that takes no more.
    pub bytes: Vec<u8>,
    /// Values of `R G B A` that half cannot hold; see [`super::EncodedExr::clamped`].
    pub clamped: u64,
}

/// Memory for packing, to be used again for the next block.
#[derive(Debug, Default)]
pub struct PackBuffers {
    line: LineBuffer,
    differences: Vec<u8>,
    deflater: Deflater,
}

impl PackBuffers {
    /// Bytes that the buffers take at most, once they have packed a block of `samples` bytes.
    pub fn predicted_bytes(samples: u64) -> u64 {
        samples + Deflater::predicted_bytes(samples)
    }
}

/// Packs the block `rows`, as [`ExrLayout::blocks`] gives it.
///
/// # Errors
/// If the codec refuses the samples.
///
/// # Panics
/// If `rows` are of a film with other planes than those of `layout`.
pub fn pack_block(
    rows: &FilmRows,
    layout: &ExrLayout,
    buffers: &mut PackBuffers,
) -> Result<PackedBlock, OutputError> {
    buffers.line.clamped = 0;
    let bytes = match layout.compression {
        Compression::None => plain(rows, layout, &mut buffers.line),
        Compression::Zip | Compression::Zips => match zip(rows, layout, buffers) {
            Some(stream) => stream.to_vec(),
            // What does not shrink is stored as it is: the length tells.
            None => {
                buffers.line.clamped = 0;
                plain(rows, layout, &mut buffers.line)
            }
        },
        Compression::Rle | Compression::Piz => by_codec(rows, layout, &mut buffers.line)?,
    };
    Ok(PackedBlock {
        y: rows.top,
        bytes,
        clamped: buffers.line.clamped,
    })
}

/// Gives the samples of `rows` to `take`, line by line in the order of the file: where in the block the line
/// begins, its bytes, and those of a sample.
fn for_each_line(
    rows: &FilmRows,
    layout: &ExrLayout,
    buffer: &mut LineBuffer,
    mut take: impl FnMut(usize, &[u8], usize),
) {
    let mut at = 0;
    for row in 0..rows.height as usize {
        for plane in &layout.planes {
            let line = buffer.line(rows, row, plane.source);
            take(at, line, plane.sample_type().bytes_per_sample());
            at += line.len();
        }
    }
}

/// The samples as they are, little-endian.
fn plain(rows: &FilmRows, layout: &ExrLayout, buffer: &mut LineBuffer) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(layout.bytes(rows.height));
    for_each_line(rows, layout, buffer, |_, line, _| {
        bytes.extend_from_slice(line);
    });
    bytes
}

/// As the crate `exr` compresses, which takes samples in the machine's order of bytes.
fn by_codec(
    rows: &FilmRows,
    layout: &ExrLayout,
    buffer: &mut LineBuffer,
) -> Result<Vec<u8>, OutputError> {
    let mut bytes = Vec::with_capacity(layout.bytes(rows.height));
    for_each_line(rows, layout, buffer, |at, line, sample| {
        bytes.extend_from_slice(line);
        if cfg!(target_endian = "big") {
            bytes[at..]
                .chunks_exact_mut(sample)
                .for_each(<[u8]>::reverse);
        }
    });
    let top = i32::try_from(rows.top).expect("images have at most 65536 rows");
    let size = Vec2(rows.width as usize, rows.height as usize);
    let section = IntegerBounds::new(Vec2(0, top), size);
    let codec = layout.compression.codec();
    let packed = codec.compress_image_section_to_le(&layout.header, bytes, section);
    packed.map_err(OutputError::Exr)
}

/// The zlib stream of `rows`, or None if it is no shorter than the samples.
fn zip<'b>(rows: &FilmRows, layout: &ExrLayout, buffers: &'b mut PackBuffers) -> Option<&'b [u8]> {
    let PackBuffers {
        line,
        differences,
        deflater,
    } = buffers;
    differences.resize(layout.bytes(rows.height), 0);
    let mut block = Differences::new(differences, Supported::default());
    for_each_line(rows, layout, line, |_, line, _| block.push(line));
    block.end();
    deflater.compress(differences, layout.pieces(rows.height))
}

impl ExrLayout {
    /// The stretches of alike planes among the differences of a block of `rows` rows.
    fn pieces(&self, rows: u32) -> impl Iterator<Item = Piece> {
        let width = self.header.layer_size.x();
        // What a particle has is the same in the row above, which is the half of a row away.
        let is_row_above_in_reach = rows > 1 && self.bytes(1) / 2 <= WINDOW;
        let groups = self.planes.chunk_by(|a, b| a.kind() == b.kind());
        let groups: Vec<(PlaneKind, usize)> = groups
            .map(|group| {
                let bytes = group
                    .iter()
                    .map(|plane| plane.sample_type().bytes_per_sample());
                (group[0].kind(), bytes.sum::<usize>() * width / 2)
            })
            .collect();
        let pieces = move |is_odd: bool| {
            let row = groups.clone().into_iter().map(move |(kind, length)| Piece {
                length,
                is_searched: match kind {
                    PlaneKind::Color | PlaneKind::Normal => false,
                    // Their exponents hardly change, so that the differences to and from them come in pairs.
                    PlaneKind::Place => is_odd,
                    PlaneKind::Particle => is_row_above_in_reach,
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
