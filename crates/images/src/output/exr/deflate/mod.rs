//! A compressor of zlib streams (RFC 1950 and 1951) for the byte differences of EXR blocks.
//!
//! A general compressor is slower: `zlib-rs` at its fastest level needs 2.5 to 3 times the CPU time for the same size
//! (`benches/encode.rs`). Half of the bytes of float samples are noise, where a match search finds nothing. Most
//! matches in the other bytes are runs: pixels without a hit, or pixels of one particle. They have a distance of 1 or
//! 2, which costs a bit or two. Matches at longer distances ([`matches`]) are searched only in a [`Piece`] where the
//! search pays off. In addition, [`block`] writes a new Huffman code for a stretch of similar planes where this saves
//! more than the header of the code costs.
//!
//! All arithmetic is on integers, so the stream is the same on every machine.

mod bits;
mod block;
mod entropy;
mod huffman;
mod matches;
mod symbols;

use bits::BitWriter;
use block::write_block;
use entropy::Histogram;
use matches::{HashTable, RunsOnly, Sequence, find_sequences};

/// Maximum distance of a match, bytes.
pub(super) const WINDOW: usize = 32 << 10;

/// Minimum saving by a new block, bits. Its header has 60 to 90 bytes, and its codes cost time in compression and
/// decompression. Tuned on the images of `benches/encode.rs`.
const BLOCK_COST: u64 = 110 * 8;

/// Pieces with fewer symbols never start a new block.
const MIN_SYMBOLS: u32 = 32;

/// Maximum length of a piece, bytes; longer ones are split. Bounds the memory for sequences.
const MAX_PIECE: usize = 32 << 10;
/// Number of sequences after which a block ends. Bounds the memory for sequences.
const MAX_SEQUENCES: usize = 16 << 10;

/// Maximum size in bytes of the vector of sequences, whose capacity doubles: those of the pending block and of the next
/// piece.
const MAX_SEQUENCE_BYTES: usize = 2 * (MAX_SEQUENCES + MAX_PIECE / 4) * size_of::<Sequence>();

/// Capacity of the stream beyond the length of the data, bytes: enough for everything that is written before
/// compression stops because the stream is too long.
const EXTRA_CAPACITY: usize = 64 << 10;

/// The first two bytes of a stream: deflate with a window of 32 KiB, no dictionary, the fastest level.
const ZLIB_HEADER: [u8; 2] = [0x78, 0x01];

/// Compresses blocks one after the other, and reuses its memory.
#[derive(Debug, Default)]
pub(super) struct Deflater {
    sequences: Vec<Sequence>,
    hash_table: HashTable,
    stream: Vec<u8>,
}

/// A stretch of bytes with similar statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece {
    /// Length in bytes.
    pub(super) length: usize,
    /// Whether to search for matches other than runs.
    pub(super) is_searched: bool,
}

impl Deflater {
    /// Size of its memory in bytes, after it has compressed `data` bytes to `packed` bytes.
    pub(super) fn predicted_bytes(data: u64, packed: u64) -> u64 {
        let sequences =
            (MAX_SEQUENCE_BYTES as u64).min(2 * size_of::<Sequence>() as u64 * (data / 4));
        packed + sequences + HashTable::BYTES as u64
    }

    /// The zlib stream of `data`, or `None` if it is no shorter. `pieces` cover all of `data`.
    pub(super) fn compress(
        &mut self,
        data: &[u8],
        pieces: impl IntoIterator<Item = Piece>,
    ) -> Option<&[u8]> {
        // Reset the memory; of the reserved capacity, only pages that are written become resident
        self.hash_table.clear();
        self.stream.clear();
        self.stream.reserve_exact(data.len() + EXTRA_CAPACITY);
        self.stream.extend_from_slice(&ZLIB_HEADER);
        let mut out = BitWriter::new(&mut self.stream);
        let mut pending = Pending::new(&mut self.sequences);
        let mut start = 0;
        for piece in pieces.into_iter().flat_map(Piece::split) {
            // Find the sequences of the piece
            let end = start + piece.length;
            let first = pending.sequences.len();
            if piece.is_searched {
                find_sequences(data, start..end, &mut self.hash_table, pending.sequences);
            } else {
                find_sequences(data, start..end, &mut RunsOnly, pending.sequences);
            }
            // Add them to the pending block, or to a new one
            let piece = Histogram::of(data, start, &pending.sequences[first..]);
            pending.add(data, piece, start, first, &mut out);
            start = end;
            if out.byte_len() >= data.len() {
                return None;
            }
        }
        debug_assert_eq!(start, data.len(), "pieces cover the data");
        // Write the last block and the checksum
        pending.write(data, data.len(), pending.sequences.len(), true, &mut out);
        out.align();
        let checksum = simd_adler32::adler32(&data);
        self.stream.extend_from_slice(&checksum.to_be_bytes());
        (self.stream.len() < data.len()).then_some(&self.stream)
    }
}

impl Piece {
    /// Splits the piece into pieces of at most [`MAX_PIECE`] bytes.
    fn split(self) -> impl Iterator<Item = Self> {
        let starts = (0..self.length).step_by(MAX_PIECE);
        starts.map(move |start| Self { length: MAX_PIECE.min(self.length - start), ..self })
    }
}

/// The block that is not written yet, because more pieces may join it.
struct Pending<'a> {
    /// Sequences of the block, and of the last piece.
    sequences: &'a mut Vec<Sequence>,
    /// Start of the block in the data.
    start: usize,
    histogram: Histogram,
    /// Cost of the `histogram`, bits.
    cost: u64,
}

impl<'a> Pending<'a> {
    fn new(sequences: &'a mut Vec<Sequence>) -> Self {
        sequences.clear();
        Self { sequences, start: 0, histogram: Histogram::default(), cost: 0 }
    }

    /// Adds `piece`, which begins at `piece_start` and whose sequences begin at index `first`. Writes the previous
    /// pieces as a separate block before, if that is cheaper.
    fn add(
        &mut self,
        data: &[u8],
        piece: Histogram,
        piece_start: usize,
        first: usize,
        out: &mut BitWriter,
    ) {
        let mut cost = self.histogram.cost_with(&piece);
        let may_split = self.histogram.counts[0] > 0 && piece.counts[0] >= MIN_SYMBOLS;
        if may_split || first >= MAX_SEQUENCES {
            let piece_cost = piece.cost();
            if self.cost + piece_cost + BLOCK_COST < cost || first >= MAX_SEQUENCES {
                self.write(data, piece_start, first, false, out);
                self.histogram = Histogram::default();
                cost = piece_cost;
            }
        }
        self.histogram.add(&piece);
        self.cost = cost;
    }

    /// Writes a block with the data before `end`, which the first `count` sequences describe.
    fn write(&mut self, data: &[u8], end: usize, count: usize, is_last: bool, out: &mut BitWriter) {
        let data = &data[self.start..end];
        write_block(data, &self.sequences[..count], &self.histogram, is_last, out);
        self.sequences.drain(..count);
        self.start = end;
    }
}

#[cfg(test)]
mod tests;
