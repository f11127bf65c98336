//! Data as literals and matches: bytes that repeat others before them.

use std::ops::Range;

use super::WINDOW;
use super::symbols::MAX_LENGTH;

/// Shorter matches are not worth their symbols.
const MIN_MATCH: usize = 4;
/// What is compared at once.
const LOOK: usize = 8;

/// Some literals, then bytes that repeat those `distance` before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sequence {
    pub(super) literals: u32,
    /// 0 if nothing repeats.
    pub(super) length: u16,
    pub(super) distance: u16,
}

/// A search for matches beside runs, which have distance 1 or 2.
pub(super) trait Search {
    /// Bytes from one look to the next.
    const STEP: usize;

    /// The distance and the length of a match at `at` of `data`, before `end`.
    fn find(&mut self, data: &[u8], at: usize, end: usize) -> Option<(usize, usize)>;
}

/// Finds no other matches.
pub(super) struct RunsAlone;

impl Search for RunsAlone {
    /// Runs of five bytes are found, wherever they begin.
    const STEP: usize = 2;

    #[inline(always)]
    fn find(&mut self, _: &[u8], _: usize, _: usize) -> Option<(usize, usize)> {
        None
    }
}

/// Finds the last position of the same four bytes.
#[derive(Debug, Default)]
pub(super) struct LastPlace {
    /// Positions by hash of the four bytes. The bytes are compared, so any entry is safe.
    places: Vec<u32>,
}

impl LastPlace {
    /// So many entries.
    const BITS: u32 = 15;
    /// Bytes of the table.
    pub(super) const BYTES: usize = size_of::<u32>() << Self::BITS;
    /// Bytes of a match that are not those two before: where there are fewer, a run costs less.
    const MIN_NEW: usize = 4;

    /// Forgets all positions, for other data.
    pub(super) fn clear(&mut self) {
        self.places.clear();
        self.places.resize(1 << Self::BITS, 0);
    }
}

impl Search for LastPlace {
    const STEP: usize = 1;

    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "blocks have less than 4 GiB"
    )]
    fn find(&mut self, data: &[u8], at: usize, end: usize) -> Option<(usize, usize)> {
        let four = first_four(eight_at(data, at - 2) >> 16);
        // The multiplier is 2^32 divided by the golden ratio.
        let hash = four.wrapping_mul(0x9e37_79b1) >> (u32::BITS - Self::BITS);
        let entry = &mut self.places[hash as usize];
        let place = *entry as usize;
        *entry = at as u32;
        let distance = at - place;
        if distance > WINDOW || data[place..place + 4] != four.to_le_bytes() {
            return None;
        }
        let length = match_length(data, at, distance, end);
        let new = data[at..at + length].iter().zip(&data[at - 2..]);
        let mut new = new.filter(|(byte, two_before)| byte != two_before);
        new.nth(Self::MIN_NEW - 1).map(|_| (distance, length))
    }
}

/// Appends the sequences of `range` of `data`, which together have its length.
pub(super) fn find_sequences<S: Search>(
    data: &[u8],
    range: Range<usize>,
    search: &mut S,
    sequences: &mut Vec<Sequence>,
) {
    let mut literals_start = range.start;
    let mut at = range.start.max(2);
    // Each look takes in the two bytes before.
    while at + MIN_MATCH <= range.end && at + LOOK - 2 <= data.len() {
        let bytes = eight_at(data, at - 2);
        let [two_before, one_before, here] = [bytes, bytes >> 8, bytes >> 16].map(first_four);
        let (distance, length) = if here == two_before {
            let distance = if here == one_before { 1 } else { 2 };
            (distance, match_length(data, at, distance, range.end))
        } else if let Some(found) = search.find(data, at, range.end) {
            found
        } else {
            at += S::STEP;
            continue;
        };
        // It may begin before the place looked at.
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

/// Bytes from `at` on, before `end`, that are those `distance` before.
fn match_length(data: &[u8], at: usize, distance: usize, end: usize) -> usize {
    let (here, before) = (&data[at..end], &data[at - distance..end - distance]);
    let mut length = 0;
    // Long runs are most of a picture's background.
    let chunks = here.as_chunks::<32>().0.iter();
    for (chunk, chunk_before) in chunks.zip(before.as_chunks::<32>().0) {
        if chunk != chunk_before {
            break;
        }
        length += chunk.len();
    }
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
    let equal = rest
        .iter()
        .zip(rest_before)
        .take_while(|(byte, before)| byte == before);
    length + equal.count()
}

/// Literals and a match, in parts that deflate has symbols for.
#[expect(
    clippy::cast_possible_truncation,
    reason = "blocks have less than 4 GiB, lengths and distances are limited"
)]
fn push(sequences: &mut Vec<Sequence>, literals: usize, length: usize, distance: usize) {
    let (mut literals, mut left) = (literals, length);
    while left > 0 {
        let length = match left {
            ..=MAX_LENGTH => left,
            // No rest that is too short.
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

/// The literals at the end of a piece.
#[expect(
    clippy::cast_possible_truncation,
    reason = "blocks have less than 4 GiB"
)]
fn push_literals(sequences: &mut Vec<Sequence>, literals: usize) {
    sequences.push(Sequence {
        literals: literals as u32,
        length: 0,
        distance: 1,
    });
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
