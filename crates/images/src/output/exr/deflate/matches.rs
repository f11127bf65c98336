//! Divides data into literals and matches, which repeat earlier bytes.

use std::ops::Range;

use super::WINDOW;
use super::symbols::MAX_LENGTH;

/// Minimum length of a match, bytes. Shorter ones would save nothing.
const MIN_MATCH: usize = 4;
/// Number of bytes that are read at once.
const WORD: usize = 8;

/// Some literals, followed by a match: `length` bytes that equal those `distance` bytes earlier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sequence {
    pub(super) literals: u32,
    /// 0 if there is no match.
    pub(super) length: u16,
    pub(super) distance: u16,
}

/// Finds matches in addition to runs, which are the matches with a distance of 1 or 2.
pub(super) trait MatchFinder {
    /// Number of bytes from one search position to the next.
    const STEP: usize;

    /// The distance and the length of a match that starts at `at` in `data` and ends at or before `end`.
    fn find(&mut self, data: &[u8], at: usize, end: usize) -> Option<(usize, usize)>;
}

/// Finds no matches except runs.
pub(super) struct RunsOnly;

impl MatchFinder for RunsOnly {
    /// With this step, runs of at least five bytes are found wherever they begin.
    const STEP: usize = 2;

    #[inline(always)]
    fn find(&mut self, _: &[u8], _: usize, _: usize) -> Option<(usize, usize)> {
        None
    }
}

/// Finds the last position with the same four bytes.
#[derive(Debug, Default)]
pub(super) struct HashTable {
    /// Last positions, by hash of four bytes. Any entry is safe, because the bytes are compared.
    positions: Vec<u32>,
}

impl HashTable {
    /// Binary logarithm of the number of entries.
    const BITS: u32 = 15;
    /// Size of the table in bytes.
    pub(super) const BYTES: usize = size_of::<u32>() << Self::BITS;
    /// Minimum number of bytes in a match that differ from the byte two positions before. With fewer, runs cost less.
    const MIN_NOT_IN_RUNS: usize = 4;

    /// Removes all positions, for other data.
    pub(super) fn clear(&mut self) {
        self.positions.clear();
        self.positions.resize(1 << Self::BITS, 0);
    }
}

impl MatchFinder for HashTable {
    const STEP: usize = 1;

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "blocks have less than 4 GiB")]
    fn find(&mut self, data: &[u8], at: usize, end: usize) -> Option<(usize, usize)> {
        // Replace the entry of these four bytes; the multiplier is 2^32 divided by the golden ratio
        let four = first_four(eight_at(data, at - 2) >> 16);
        let hash = four.wrapping_mul(0x9e37_79b1) >> (u32::BITS - Self::BITS);
        let entry = &mut self.positions[hash as usize];
        let last = *entry as usize;
        *entry = at as u32;
        let distance = at - last;
        if distance > WINDOW || data[last..last + 4] != four.to_le_bytes() {
            return None;
        }
        // Reject matches that consist mostly of runs
        let length = match_length(data, at, distance, end);
        let pairs = data[at..at + length].iter().zip(&data[at - 2..]);
        let mut not_in_runs = pairs.filter(|(byte, two_before)| byte != two_before);
        let last_required = not_in_runs.nth(Self::MIN_NOT_IN_RUNS - 1);
        last_required.map(|_| (distance, length))
    }
}

/// Appends sequences that describe exactly `range` of `data`.
pub(super) fn find_sequences<F: MatchFinder>(
    data: &[u8],
    range: Range<usize>,
    finder: &mut F,
    sequences: &mut Vec<Sequence>,
) {
    let mut literals_start = range.start;
    let mut at = range.start.max(2);
    // The word at each position includes the two bytes before it
    while at + MIN_MATCH <= range.end && at + WORD - 2 <= data.len() {
        // Find a run or another match
        let bytes = eight_at(data, at - 2);
        let [two_before, one_before, here] = [bytes, bytes >> 8, bytes >> 16].map(first_four);
        let (distance, length) = if here == two_before {
            let distance = if here == one_before { 1 } else { 2 };
            (distance, match_length(data, at, distance, range.end))
        } else if let Some(found) = finder.find(data, at, range.end) {
            found
        } else {
            at += F::STEP;
            continue;
        };
        // Extend the match backwards
        let mut start = at;
        while start > literals_start.max(distance) && data[start - 1] == data[start - 1 - distance]
        {
            start -= 1;
        }
        at += length;
        push(sequences, start - literals_start, at - start, distance);
        literals_start = at;
    }
    if literals_start < range.end {
        push_literals(sequences, range.end - literals_start);
    }
}

/// Number of bytes from `at` on, before `end`, that equal the bytes `distance` earlier.
fn match_length(data: &[u8], at: usize, distance: usize, end: usize) -> usize {
    let (here, before) = (&data[at..end], &data[at - distance..end - distance]);
    let mut length = 0;
    // Compare long chunks first: most of a background is long runs
    let chunks = here.as_chunks::<32>().0.iter();
    for (chunk, chunk_before) in chunks.zip(before.as_chunks::<32>().0) {
        if chunk != chunk_before {
            break;
        }
        length += chunk.len();
    }
    // Compare the rest in words, then in bytes
    let (here, before) = (&here[length..], &before[length..]);
    let (eights, rest) = here.as_chunks::<8>();
    let (eights_before, rest_before) = before.as_chunks::<8>();
    for (eight, eight_before) in eights.iter().zip(eights_before) {
        let differing = u64::from_le_bytes(*eight) ^ u64::from_le_bytes(*eight_before);
        if differing != 0 {
            return length + differing.trailing_zeros() as usize / 8;
        }
        length += eight.len();
    }
    let equal = rest.iter().zip(rest_before).take_while(|(byte, before)| byte == before);
    length + equal.count()
}

/// Appends literals and a match, divided into lengths that deflate can represent.
#[expect(
    clippy::cast_possible_truncation,
    reason = "blocks have less than 4 GiB, lengths and distances are limited"
)]
fn push(sequences: &mut Vec<Sequence>, literals: usize, length: usize, distance: usize) {
    let (mut literals, mut left) = (literals, length);
    while left > 0 {
        let length = match left {
            ..=MAX_LENGTH => left,
            // Leave no remainder that is too short for a match
            _ => MAX_LENGTH.min(left - MIN_MATCH),
        };
        sequences.push(Sequence {
            literals: literals as u32,
            length: length as u16,
            distance: distance as u16,
        });
        literals = 0;
        left -= length;
    }
}

/// Appends the literals at the end of a piece.
#[expect(clippy::cast_possible_truncation, reason = "blocks have less than 4 GiB")]
fn push_literals(sequences: &mut Vec<Sequence>, literals: usize) {
    sequences.push(Sequence { literals: literals as u32, length: 0, distance: 1 });
}

#[inline(always)]
fn eight_at(data: &[u8], at: usize) -> u64 {
    let bytes = data[at..at + 8].try_into();
    u64::from_le_bytes(bytes.expect("eight bytes"))
}

#[inline(always)]
const fn first_four(bytes: u64) -> u32 {
    (bytes & 0xffff_ffff) as u32
}
