//! Writes one block of a deflate stream: its Huffman codes and its symbols, or its bytes uncompressed.

use super::bits::BitWriter;
use super::entropy::Histogram;
use super::huffman::{Code, MAX_BITS, codes};
use super::matches::Sequence;
use super::symbols::{
    DISTANCES, END, LENGTH_VALUES, MAX_LENGTH, SYMBOLS, Value, distance_bits, distance_value,
    length_bits,
};

/// Maximum length of the code of a literal or length, bits: four of them and the bits of an incomplete byte fit into a
/// register.
const MAX_SYMBOL_BITS: usize = 14;
/// Maximum length of the code of a code length, bits.
const MAX_HEADER_BITS: usize = 7;
/// Number of symbols of the code for code lengths: the lengths 0 to 15, a repetition, and two kinds of runs of zeros.
const LENGTH_CODES: usize = 19;
const REPEAT: u8 = 16;
const ZEROS: u8 = 17;
const MANY_ZEROS: u8 = 18;
/// The order in which the lengths of the codes for code lengths are written.
const LENGTH_CODE_ORDER: [usize; LENGTH_CODES] =
    [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
/// Maximum number of bytes in a stored block.
const MAX_STORED: usize = 0xffff;

/// Appends `data` as a block. `sequences` describe all of it, and `histogram` has counted their symbols.
pub(super) fn write_block(
    data: &[u8],
    sequences: &[Sequence],
    histogram: &Histogram,
    is_last: bool,
    out: &mut BitWriter,
) {
    let (mut symbols, mut distances) = (histogram.symbols, histogram.distances);
    symbols[END] = 1;
    // A Huffman code needs at least two symbols; add unused ones
    symbols[0] = symbols[0].max(u32::from(histogram.counts[0] == 0));
    let used = distances.iter().filter(|count| **count > 0).count();
    if used < 2 {
        distances[0] = distances[0].max(1);
        distances[1] = distances[1].max(1);
    }
    // Make the codes, and store the data if that takes fewer bits
    let codes =
        Codes { symbols: codes(&symbols, MAX_SYMBOL_BITS), distances: codes(&distances, MAX_BITS) };
    let header = Header::of(&codes);
    let bits = 3 + header.bits() + codes.bits(&symbols, &distances);
    if stored_bits(data) <= bits {
        write_stored(data, is_last, out);
        return;
    }
    // Write the block with dynamic codes (type 2)
    out.reserve(bits);
    out.put(u64::from(is_last) | 2 << 1, 3);
    header.write(out);
    write_symbols(data, sequences, &codes, out);
}

/// The Huffman codes of a block.
struct Codes {
    symbols: [Code; SYMBOLS],
    distances: [Code; DISTANCES],
}

impl Codes {
    /// Number of bits of all symbols, including their extra bits.
    fn bits(&self, symbols: &[u32; SYMBOLS], distances: &[u32; DISTANCES]) -> u64 {
        let bits = |counts: &[u32], codes: &[Code], extra_bits: fn(usize) -> u32| -> u64 {
            let all = counts.iter().zip(codes).enumerate();
            all.map(|(symbol, (count, code))| {
                let bits = u32::from(code.length) + extra_bits(symbol);
                u64::from(*count) * u64::from(bits)
            })
            .sum()
        };
        bits(symbols, &self.symbols, length_bits) + bits(distances, &self.distances, distance_bits)
    }
}

/// Number of bits of `data` in stored blocks, each with a header of 5 bytes.
fn stored_bits(data: &[u8]) -> u64 {
    8 * (data.len() as u64 + 5 * data.len().div_ceil(MAX_STORED) as u64)
}

#[expect(clippy::cast_possible_truncation, reason = "stored blocks have at most 65535 bytes")]
fn write_stored(data: &[u8], is_last: bool, out: &mut BitWriter) {
    let chunks = data.chunks(MAX_STORED);
    let count = chunks.len();
    for (chunk, number) in chunks.zip(1..) {
        out.reserve(3);
        out.put(u64::from(is_last && number == count), 3);
        out.align();
        let length = chunk.len() as u16;
        out.extend(&length.to_le_bytes());
        out.extend(&(!length).to_le_bytes());
        out.extend(chunk);
    }
}

/// The header of a block: the lengths of its codes (RFC 1951, section 3.2.7).
struct Header {
    /// Number of symbols with a code length in the header: up to the last one that occurs.
    symbols: usize,
    /// The same for distances.
    distances: usize,
    /// All code lengths.
    lengths: Vec<LengthCode>,
    /// The codes for code lengths.
    codes: [Code; LENGTH_CODES],
    /// Number of `codes` in the header, in [`LENGTH_CODE_ORDER`].
    code_count: usize,
}

/// A symbol of the code for code lengths: one length, or several equal ones.
#[derive(Clone, Copy)]
struct LengthCode {
    symbol: u8,
    /// Number of repetitions minus the minimum of the symbol.
    extra: u8,
    extra_bits: u8,
}

impl Header {
    fn of(codes: &Codes) -> Self {
        // Collect the lengths of the codes in use
        let used = |codes: &[Code], least: usize| {
            let last = codes.iter().rposition(|code| code.length > 0);
            least.max(last.map_or(0, |last| last + 1))
        };
        let symbols = used(&codes.symbols, END + 1);
        let distances = used(&codes.distances, 1);
        let all = codes.symbols[..symbols].iter().chain(&codes.distances[..distances]);
        let mut lengths = [0; SYMBOLS + DISTANCES];
        for (length, code) in lengths.iter_mut().zip(all) {
            *length = code.length;
        }
        // Shorten repetitions, and make the codes of what remains
        let lengths = length_codes(&lengths[..symbols + distances]);
        let mut counts = [0; LENGTH_CODES];
        for code in &lengths {
            counts[usize::from(code.symbol)] += 1;
        }
        let codes = self::codes(&counts, MAX_HEADER_BITS);
        let last = LENGTH_CODE_ORDER.iter().rposition(|symbol| codes[*symbol].length > 0);
        Self {
            symbols,
            distances,
            lengths,
            codes,
            code_count: last.map_or(4, |last| 4.max(last + 1)),
        }
    }

    /// Number of bits of the header.
    fn bits(&self) -> u64 {
        let lengths = self.lengths.iter().map(|code| {
            let symbol = self.codes[usize::from(code.symbol)].length;
            u64::from(symbol + code.extra_bits)
        });
        5 + 5 + 4 + 3 * self.code_count as u64 + lengths.sum::<u64>()
    }

    fn write(&self, out: &mut BitWriter) {
        out.put(self.symbols as u64 - 257, 5);
        out.put(self.distances as u64 - 1, 5);
        out.put(self.code_count as u64 - 4, 4);
        out.flush();
        for symbol in &LENGTH_CODE_ORDER[..self.code_count] {
            out.put(u64::from(self.codes[*symbol].length), 3);
            out.flush();
        }
        for code in &self.lengths {
            let symbol = self.codes[usize::from(code.symbol)];
            out.put(u64::from(symbol.bits), u32::from(symbol.length));
            out.put(u64::from(code.extra), u32::from(code.extra_bits));
            out.flush();
        }
    }
}

/// Code lengths as symbols, with one symbol for a repetition.
#[expect(clippy::cast_possible_truncation, reason = "a repetition has at most 138 lengths")]
fn length_codes(lengths: &[u8]) -> Vec<LengthCode> {
    let mut codes = Vec::with_capacity(lengths.len());
    let mut push = |symbol, extra: usize, extra_bits| {
        codes.push(LengthCode { symbol, extra: extra as u8, extra_bits });
    };
    for equal in lengths.chunk_by(|a, b| a == b) {
        let length = equal[0];
        let mut left = equal.len();
        // A repetition refers to the length before it, except for zeros
        if length != 0 {
            push(length, 0, 0);
            left -= 1;
        }
        // Use the longest repetitions that there are symbols for
        while left >= 3 {
            let count = match (length, left) {
                (0, ..11) => {
                    push(ZEROS, left - 3, 3);
                    left
                }
                (0, _) => {
                    push(MANY_ZEROS, left.min(138) - 11, 7);
                    left.min(138)
                }
                _ => {
                    push(REPEAT, left.min(6) - 3, 2);
                    left.min(6)
                }
            };
            left -= count;
        }
        for _ in 0..left {
            push(length, 0, 0);
        }
    }
    codes
}

/// The bits of a symbol and of its extra bits, and their number.
#[derive(Clone, Copy, Default)]
struct Bits {
    bits: u32,
    count: u32,
}

impl Bits {
    fn of(code: Code) -> Self {
        Self { bits: u32::from(code.bits), count: u32::from(code.length) }
    }

    #[inline(always)]
    fn of_value(value: Value, codes: &[Code], extra_bits: fn(usize) -> u32) -> Self {
        let symbol = usize::from(value.symbol);
        Self::of(codes[symbol]).and(u32::from(value.extra), extra_bits(symbol))
    }

    /// These bits, followed by `count` more.
    fn and(self, bits: u32, count: u32) -> Self {
        Self { bits: self.bits | bits << self.count, count: self.count + count }
    }
}

fn write_symbols(data: &[u8], sequences: &[Sequence], codes: &Codes, out: &mut BitWriter) {
    // Prepare the bits of each literal and length
    let literals: [Bits; END] = std::array::from_fn(|literal| Bits::of(codes.symbols[literal]));
    let lengths: [Bits; MAX_LENGTH + 1] = std::array::from_fn(|length| {
        Bits::of_value(LENGTH_VALUES[length], &codes.symbols, length_bits)
    });
    let mut at = 0;
    // Write literals, then the copy that follows them
    for sequence in sequences {
        let end = at + sequence.literals as usize;
        write_literals(&data[at..end], &literals, out);
        at = end + usize::from(sequence.length);
        if sequence.length > 0 {
            let length = lengths[usize::from(sequence.length)];
            out.put(u64::from(length.bits), length.count);
            let value = distance_value(sequence.distance);
            let distance = Bits::of_value(value, &codes.distances, distance_bits);
            out.put(u64::from(distance.bits), distance.count);
            out.flush();
        }
    }
    // Write the end of the block
    let end = Bits::of(codes.symbols[END]);
    out.put(u64::from(end.bits), end.count);
    out.flush();
}

#[inline(always)]
fn write_literals(bytes: &[u8], literals: &[Bits; END], out: &mut BitWriter) {
    let (fours, rest) = bytes.as_chunks::<4>();
    for four in fours {
        // Join two pairs, to have shorter dependency chains
        let [a, b, c, d] = four.map(|byte| literals[usize::from(byte)]);
        let (first, second) = (a.and(b.bits, b.count), c.and(d.bits, d.count));
        out.put(u64::from(first.bits), first.count);
        out.put(u64::from(second.bits), second.count);
        out.flush();
    }
    for byte in rest {
        let literal = literals[usize::from(*byte)];
        out.put(u64::from(literal.bits), literal.count);
        out.flush();
    }
}
