//! A compressor of zlib streams (RFC 1950 and 1951) for the byte differences of EXR blocks.
//!
//! Why not a general compressor: `zlib-rs` at its fastest level needs 2.5 to 3 times the CPU time for the same size
//! (`benches/encode.rs`). Half of the bytes of float samples are noise, where a match search finds nothing. The other
//! matches are mostly runs: pixels without a hit, or pixels of one particle. So nearly all matches have distance 1 or 2,
//! which costs a bit or two, and longer [`matches`] are searched only in a [`Piece`] where the search pays. In return,
//! [`block`] writes a Huffman code for each stretch of similar planes where the saving exceeds the size of its header.
//!
//! Everything is integer arithmetic, so the stream is the same on every machine.

mod bits;
mod block;
mod entropy;
mod huffman;
mod matches;
mod symbols;

use bits::BitWriter;
use block::write_block;
use entropy::Histogram;
use matches::{LastPlace, RunsAlone, Sequence, find_sequences};

/// Longest distance of a match.
pub(super) const WINDOW: usize = 32 << 10;

/// What a further block has to save, in bits: its header has 60 to 90 bytes, and both sides need time for its codes.
/// Chosen on the images of `benches/encode.rs`.
const BLOCK_COST: u64 = 110 * 8;

/// Pieces with fewer symbols never begin a block.
const FEW_SYMBOLS: u32 = 32;

/// Longest piece, and the sequences from which on a block ends: they bound the memory that sequences take.
const LONGEST_PIECE: usize = 32 << 10;
const MANY_SEQUENCES: usize = 16 << 10;

/// Most bytes that the sequences of a block that is not written yet take, with those of the next piece, in a vector
/// that doubles.
const SEQUENCE_BYTES: usize = 2 * (MANY_SEQUENCES + LONGEST_PIECE / 4) * size_of::<Sequence>();

/// Bytes beyond those of the data that are enough for whatever is written until the stream turns out to be too long.
const ROOM: usize = 64 << 10;

/// The first two bytes of a stream: deflate with a window of 32 KiB, no dictionary, the fastest level.
const ZLIB_HEADER: [u8; 2] = [0x78, 0x01];

/// Compresses blocks in the same memory, one after the other.
#[derive(Debug, Default)]
pub(super) struct Deflater {
    sequences: Vec<Sequence>,
    last_place: LastPlace,
    stream: Vec<u8>,
}

/// A stretch of alike bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) length: usize,
    /// Whether to look for matches beside runs.
    pub(super) is_searched: bool,
}

impl Deflater {
    /// Bytes of its memory, at most, once it has compressed as many as `data`.
    pub(super) fn predicted_bytes(data: u64) -> u64 {
        let sequences = (SEQUENCE_BYTES as u64).min(2 * size_of::<Sequence>() as u64 * (data / 4));
        data + sequences + LastPlace::BYTES as u64
    }

    /// The zlib stream of `data`, or `None` if it is no shorter. `pieces` are all of it.
    pub(super) fn compress(
        &mut self,
        data: &[u8],
        pieces: impl IntoIterator<Item = Piece>,
    ) -> Option<&[u8]> {
        self.last_place.clear();
        self.stream.clear();
        // No more than is used becomes memory.
        self.stream.reserve_exact(data.len() + ROOM);
        self.stream.extend_from_slice(&ZLIB_HEADER);
        let mut out = BitWriter::new(&mut self.stream);
        let mut pending = Pending::new(&mut self.sequences);
        let mut start = 0;
        for piece in pieces.into_iter().flat_map(Piece::cut) {
            let end = start + piece.length;
            let known = pending.sequences.len();
            if piece.is_searched {
                find_sequences(data, start..end, &mut self.last_place, pending.sequences);
            } else {
                find_sequences(data, start..end, &mut RunsAlone, pending.sequences);
            }
            let piece = Histogram::of(data, start, &pending.sequences[known..]);
            pending.take_in(data, piece, start, known, &mut out);
            start = end;
            if out.byte_len() >= data.len() {
                return None;
            }
        }
        debug_assert_eq!(start, data.len(), "pieces cover the data");
        pending.write(data, data.len(), pending.sequences.len(), true, &mut out);
        out.align();
        let checksum = simd_adler32::adler32(&data);
        self.stream.extend_from_slice(&checksum.to_be_bytes());
        (self.stream.len() < data.len()).then_some(&self.stream)
    }
}

impl Piece {
    /// Parts of at most [`LONGEST_PIECE`] bytes.
    fn cut(self) -> impl Iterator<Item = Self> {
        let starts = (0..self.length).step_by(LONGEST_PIECE);
        starts.map(move |start| Self {
            length: LONGEST_PIECE.min(self.length - start),
            ..self
        })
    }
}

/// The block that is not written yet, as more pieces may join it.
struct Pending<'a> {
    /// Those of the block, and of the piece that was found last.
    sequences: &'a mut Vec<Sequence>,
    /// Where it begins.
    start: usize,
    histogram: Histogram,
    /// Of `histogram`.
    cost: u64,
}

impl<'a> Pending<'a> {
    fn new(sequences: &'a mut Vec<Sequence>) -> Self {
        sequences.clear();
        Self {
            sequences,
            start: 0,
            histogram: Histogram::default(),
            cost: 0,
        }
    }

    /// Adds `piece`, which begins at `piece_start` and whose sequences begin at place `known`; writes what there was
    /// as a block of its own if that is cheaper.
    fn take_in(
        &mut self,
        data: &[u8],
        piece: Histogram,
        piece_start: usize,
        known: usize,
        out: &mut BitWriter,
    ) {
        let mut together = self.histogram.cost_with(&piece);
        let may_part = self.histogram.counts[0] > 0 && piece.counts[0] >= FEW_SYMBOLS;
        if may_part || known >= MANY_SEQUENCES {
            let alone = piece.cost();
            if self.cost + alone + BLOCK_COST < together || known >= MANY_SEQUENCES {
                self.write(data, piece_start, known, false, out);
                self.histogram = Histogram::default();
                together = alone;
            }
        }
        self.histogram.add(&piece);
        self.cost = together;
    }

    /// Writes the data before `end`, which the first `count` sequences are.
    fn write(&mut self, data: &[u8], end: usize, count: usize, is_last: bool, out: &mut BitWriter) {
        let data = &data[self.start..end];
        write_block(
            data,
            &self.sequences[..count],
            &self.histogram,
            is_last,
            out,
        );
        self.sequences.drain(..count);
        self.start = end;
    }
}

#[cfg(test)]
mod tests;
