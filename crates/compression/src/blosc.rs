//! Frames of Blosc 1: a header of 16 bytes, the places of the blocks, and the blocks, each of one or several streams.
//!
//! After "Blosc Chunk Format" of c-blosc. The decoders of streams are those of other compressions. The frame around them
//! is small, and the established crates for it bind the C library.

use std::io;

use flate2::{Decompress, FlushDecompress, Status};

/// Bytes of a frame before the places of its blocks.
pub(super) const HEADER: usize = 16;

/// Flags of a header.
const IS_SHUFFLED: u8 = 1;
const IS_STORED: u8 = 2;
const IS_BIT_SHUFFLED: u8 = 4;
const IS_NOT_SPLIT: u8 = 0x10;

/// A block is split into a stream for each byte of its elements only if these have no more bytes.
const MAX_SPLITS: usize = 16;
/// And only if each stream has at least so many bytes.
const MIN_STREAM: usize = 128;

/// The header of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameHeader {
    flags: u8,
    /// Bytes of an element, for the shuffle.
    type_size: usize,
    /// Bytes of the content.
    pub(super) len: usize,
    /// Bytes of the content of a block; the last one may have fewer.
    block_len: usize,
    /// Bytes of the frame.
    frame_len: usize,
}

impl FrameHeader {
    /// The header in `bytes`; `None` if no frame begins there.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let (head, numbers) = bytes.split_first_chunk::<4>()?;
        let [version, _codec_version, flags, type_size] = *head;
        let [len, block_len, frame_len] = *numbers.as_chunks::<4>().0.first_chunk::<3>()?;
        let number = |bytes| usize::try_from(u32::from_le_bytes(bytes)).ok();
        let header = Self {
            flags,
            type_size: type_size.into(),
            len: number(len)?,
            block_len: number(block_len)?,
            frame_len: number(frame_len)?,
        };
        let is_frame = matches!(version, 1 | 2)
            && header.type_size > 0
            && header.len > 0
            && header.block_len > 0
            && header.frame_len >= HEADER;
        is_frame.then_some(header)
    }

    /// Bytes of the frame after the header.
    ///
    /// # Errors
    /// [`io::Error`] if a frame of so much content cannot be so long.
    pub(super) fn body_len(&self) -> io::Result<usize> {
        let body_len = self.frame_len - HEADER;
        if body_len <= self.len {
            Ok(body_len)
        } else {
            Err(damaged("a frame is longer than its content"))
        }
    }

    /// Most bytes that decoding the frame takes: the frame, a block and a shuffled block.
    pub(super) const fn decoder_len(&self) -> u64 {
        3 * self.len as u64 + HEADER as u64
    }

    const fn has(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    /// Number of blocks.
    pub(super) const fn block_count(&self) -> usize {
        self.len.div_ceil(self.block_len)
    }

    /// Number of streams of a block of `len` bytes.
    const fn stream_count(&self, len: usize) -> usize {
        let is_split = !self.has(IS_NOT_SPLIT)
            && len == self.block_len
            && self.type_size <= MAX_SPLITS
            && self.block_len / self.type_size >= MIN_STREAM;
        if is_split { self.type_size } else { 1 }
    }
}

/// Decodes the blocks of a frame. Keeps its buffers for the next one.
#[derive(Debug, Default)]
pub(super) struct BlockDecoder {
    /// The frame after its header.
    pub(super) body: Vec<u8>,
    shuffled: Vec<u8>,
}

impl BlockDecoder {
    /// Decodes block `index` of the frame in [`Self::body`] into `output`.
    ///
    /// # Errors
    /// [`io::Error`] for damage, and with [`io::ErrorKind::Unsupported`] for codecs that are not read.
    pub(super) fn decode(
        &mut self,
        header: &FrameHeader,
        index: usize,
        output: &mut Vec<u8>,
    ) -> io::Result<()> {
        let first = index * header.block_len;
        let len = header.block_len.min(header.len - first);
        if header.has(IS_STORED) {
            let content = self
                .body
                .get(first..first + len)
                .ok_or_else(|| damaged("a stored frame is too short"))?;
            output.clear();
            output.extend_from_slice(content);
            return Ok(());
        }
        if header.has(IS_BIT_SHUFFLED) {
            return Err(unsupported("shuffled by bits"));
        }
        let is_shuffled = header.has(IS_SHUFFLED) && header.type_size > 1;
        // Find the block
        let place = self
            .body
            .get(4 * index..)
            .and_then(|rest| rest.first_chunk())
            .ok_or_else(|| damaged("a frame ends before its blocks"))?;
        let place = u32::from_le_bytes(*place) as usize;
        let mut rest = place
            .checked_sub(HEADER)
            .and_then(|at| self.body.get(at..))
            .ok_or_else(|| damaged("a block is outside its frame"))?;
        // Decode its streams
        let decoded = if is_shuffled { &mut self.shuffled } else { &mut *output };
        decoded.resize(len, 0);
        let stream_len = len / header.stream_count(len);
        for stream in decoded.chunks_mut(stream_len) {
            let compressed = next_stream(&mut rest)?;
            if compressed.len() == stream.len() {
                stream.copy_from_slice(compressed);
            } else {
                decompress(header.flags >> 5, compressed, stream)?;
            }
        }
        if is_shuffled {
            output.resize(len, 0);
            unshuffle(&self.shuffled, header.type_size, output);
        }
        Ok(())
    }
}

/// Takes the next stream of a block, which is behind its length.
fn next_stream<'a>(rest: &mut &'a [u8]) -> io::Result<&'a [u8]> {
    let stream = rest.split_first_chunk().and_then(|(len, behind)| {
        let len = usize::try_from(u32::from_le_bytes(*len)).ok()?;
        behind.split_at_checked(len)
    });
    let (stream, behind) = stream.ok_or_else(|| damaged("a block ends within a stream"))?;
    *rest = behind;
    Ok(stream)
}

/// Decodes a stream of the codec with this number, which must fill `output`.
fn decompress(codec: u8, compressed: &[u8], output: &mut [u8]) -> io::Result<()> {
    let written = match codec {
        1 => lz4_flex::block::decompress_into(compressed, output)
            .map_err(|error| damaged(&error.to_string()))?,
        3 => {
            let mut zlib = Decompress::new(true);
            let status = zlib.decompress(compressed, output, FlushDecompress::Finish);
            match status.map_err(|error| damaged(&error.to_string()))? {
                Status::StreamEnd => usize::try_from(zlib.total_out()).unwrap_or(usize::MAX),
                Status::Ok | Status::BufError => {
                    return Err(damaged("a stream has another length"));
                }
            }
        }
        0 => return Err(unsupported("compressed with BloscLZ")),
        2 => return Err(unsupported("compressed with Snappy")),
        4 => return Err(unsupported("compressed with zstd")),
        _ => return Err(damaged("an unknown codec")),
    };
    if written == output.len() { Ok(()) } else { Err(damaged("a stream has another length")) }
}

/// Puts the bytes of each element together again: `shuffled` has the first bytes of all elements, then the second ones.
/// Bytes after the last element are in their places.
fn unshuffle(shuffled: &[u8], type_size: usize, output: &mut [u8]) {
    let count = shuffled.len() / type_size;
    let (lanes, rest) = shuffled.split_at(count * type_size);
    let (elements, output_rest) = output.split_at_mut(count * type_size);
    output_rest.copy_from_slice(rest);
    if count == 0 {
        return;
    }
    for (place, lane) in lanes.chunks_exact(count).enumerate() {
        for (element, byte) in elements.chunks_exact_mut(type_size).zip(lane) {
            element[place] = *byte;
        }
    }
}

pub(super) fn damaged(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

fn unsupported(how: &str) -> io::Error {
    let what = format!(
        "its blosc frames are {how}, which is not read; compress it with LZ4, as `hsc` of Houdini does"
    );
    io::Error::new(io::ErrorKind::Unsupported, what)
}
