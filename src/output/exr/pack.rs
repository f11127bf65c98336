//! One block of rows into the bytes that its file has for it.
//!
//! ZIP of OpenEXR ("Technical Introduction to OpenEXR", and `ImfZip.cpp` of the reference library): the bytes of
//! little-endian samples, row by row and in each row plane by plane, are parted into those at even and those at
//! odd places; each byte becomes its difference to the one before, plus 128; what comes of it is a zlib stream.
//! The loops go from one buffer into another, so that they vectorise.
//!
//! Bytes depend on samples and layout alone: every block starts a new stream, and `zlib-rs` finds the same
//! matches with and without vector instructions.

use exr::math::Vec2;
use exr::prelude::IntegerBounds;
use zlib_rs::{DeflateConfig, ReturnCode, Strategy, compress_slice};

use super::layout::ExrLayout;
use super::lines::LineBuffer;
use super::{Compression, OutputError};
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

/// Memory for packing, to be used again for the next block: about twice the bytes of a block's samples.
#[derive(Debug, Default)]
pub struct PackBuffers {
    line: LineBuffer,
    /// Bytes at even places, then those at odd places; later the zlib stream.
    parted: Vec<u8>,
    differences: Vec<u8>,
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
fn zip<'b>(
    rows: &FilmRows,
    layout: &ExrLayout,
    buffers: &'b mut PackBuffers,
) -> Option<&'b mut [u8]> {
    let PackBuffers {
        line,
        parted,
        differences,
    } = buffers;
    let length = layout.bytes(rows.height);
    parted.resize(length, 0);
    differences.resize(length, 0);
    // All samples have an even number of bytes, so both halves are of one length.
    let (even, odd) = parted.split_at_mut(length / 2);
    for_each_line(rows, layout, line, |at, line, _| {
        let places = at / 2..(at + line.len()) / 2;
        part(line, &mut even[places.clone()], &mut odd[places]);
    });
    differ(parted, differences);
    let room = length.checked_sub(1)?;
    let (stream, code) = compress_slice(&mut parted[..room], differences, layout.deflate());
    (code == ReturnCode::Ok).then_some(stream)
}

/// Bytes at even places and bytes at odd places.
fn part(bytes: &[u8], even: &mut [u8], odd: &mut [u8]) {
    let (pairs, _) = bytes.as_chunks::<2>();
    for ((even, odd), pair) in even.iter_mut().zip(odd).zip(pairs) {
        [*even, *odd] = *pair;
    }
}

/// What each byte is more than the one before, around 128; the first stays as it is.
fn differ(bytes: &[u8], differences: &mut [u8]) {
    let Some((first, others)) = differences.split_first_mut() else {
        return;
    };
    *first = bytes[0];
    for ((difference, before), byte) in others.iter_mut().zip(bytes).zip(&bytes[1..]) {
        *difference = byte.wrapping_sub(*before).wrapping_add(128);
    }
}

/// Farthest match of deflate.
const WINDOW: usize = 32 << 10;

impl ExrLayout {
    /// What deflate does for these planes, chosen by size and time over images of the thesis's box and of a
    /// splashing dam break (`benches/encode.rs`).
    fn deflate(&self) -> DeflateConfig {
        let fast = DeflateConfig::default();
        let colors_alone = self.planes.len() == 4;
        if colors_alone {
            // Differences of shaded pixels repeat nothing but themselves: to look only for runs is quicker, and
            // gives 4 to 5 % less than to look for any match, as it leaves Huffman's code alone with the rest.
            return DeflateConfig {
                strategy: Strategy::Rle,
                ..fast
            };
        }
        // Ids and normals repeat what is in the row above, which is a row's half away. Where it is out of
        // reach, more has to be tried for the same size.
        let is_row_above_in_reach = self.bytes(1) / 2 < WINDOW;
        DeflateConfig {
            level: if is_row_above_in_reach { 2 } else { 3 },
            mem_level: 9,
            ..fast
        }
    }
}

#[cfg(test)]
#[path = "pack_tests.rs"]
mod tests;
