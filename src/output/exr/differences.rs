//! The bytes that EXR's ZIP hands to its compressor, made line by line as the lines come.
//!
//! ZIP of OpenEXR ("Technical Introduction to OpenEXR", and `ImfZip.cpp` of the reference library): the bytes of
//! little-endian samples, row by row and in each row plane by plane, are parted into those at even and those at
//! odd places; each byte becomes its difference to the one before, plus 128.

use crate::math::{Supported, lane_kernel};

/// What a byte that equals the one before becomes.
const NO_DIFFERENCE: u8 = 128;

/// A block whose lines come one after the other.
pub(super) struct Differences<'a> {
    /// Of bytes at even places, and of those at odd ones.
    even: &'a mut [u8],
    odd: &'a mut [u8],
    /// Pairs so far.
    count: usize,
    /// The last of them.
    before: [u8; 2],
    level: Supported,
}

impl<'a> Differences<'a> {
    /// Of a block with as many bytes as `into`, which is an even number: no sample has an odd one.
    pub(super) fn new(into: &'a mut [u8], level: Supported) -> Self {
        let (even, odd) = into.split_at_mut(into.len() / 2);
        Self {
            even,
            odd,
            count: 0,
            // The very first byte stays as it is.
            before: [NO_DIFFERENCE; 2],
            level,
        }
    }

    /// Takes in the next bytes of the block.
    pub(super) fn push(&mut self, line: &[u8]) {
        let (pairs, _) = line.as_chunks::<2>();
        let places = self.count..self.count + pairs.len();
        let (even, odd) = (&mut self.even[places.clone()], &mut self.odd[places]);
        let ([first, ..], [.., last]) = (pairs, pairs) else {
            return;
        };
        [even[0], odd[0]] = difference(*first, self.before);
        differ(self.level, pairs, &mut even[1..], &mut odd[1..]);
        self.count += pairs.len();
        self.before = *last;
    }

    /// Ends the block: the first byte at an odd place comes after the last one at an even place.
    pub(super) fn end(self) {
        if let Some(first) = self.odd.first_mut() {
            *first = first
                .wrapping_sub(self.before[0])
                .wrapping_add(NO_DIFFERENCE);
        }
    }
}

#[inline(always)]
fn difference(pair: [u8; 2], before: [u8; 2]) -> [u8; 2] {
    let byte = |place: usize| {
        pair[place]
            .wrapping_sub(before[place])
            .wrapping_add(NO_DIFFERENCE)
    };
    [byte(0), byte(1)]
}

lane_kernel! {
    /// The differences of all `pairs` but the first.
    fn differ(pairs: &[[u8; 2]], even: &mut [u8], odd: &mut [u8]) = differ_body;
}

#[inline(always)]
fn differ_body(pairs: &[[u8; 2]], even: &mut [u8], odd: &mut [u8]) {
    let neighbours = pairs.iter().zip(&pairs[1..]);
    for ((even, odd), (before, pair)) in even.iter_mut().zip(odd).zip(neighbours) {
        [*even, *odd] = difference(*pair, *before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SimdLevel;

    /// As `ImfZip.cpp` does it, in two passes.
    fn by_the_book(bytes: &[u8]) -> Vec<u8> {
        let even = bytes.iter().step_by(2);
        let parted: Vec<u8> = even
            .chain(bytes.iter().skip(1).step_by(2))
            .copied()
            .collect();
        let others = parted.windows(2);
        let others = others.map(|pair| pair[1].wrapping_sub(pair[0]).wrapping_add(128));
        parted.iter().take(1).copied().chain(others).collect()
    }

    #[test]
    fn lines_give_what_the_whole_block_does() {
        let bytes: Vec<u8> = (0..4000_u32)
            .map(|at| (at * at / 7).to_le_bytes()[0])
            .collect();
        for lengths in [
            &[4000][..],
            &[2, 2, 0, 4, 60, 62, 64, 66, 130, 1000],
            &[0],
            &[2],
        ] {
            for level in SimdLevel::ALL {
                let length: usize = lengths.iter().sum();
                let mut differences = vec![1; length];
                let mut block = Differences::new(&mut differences, Supported::or_best(level));
                let mut rest = &bytes[..length];
                for length in lengths {
                    let (line, others) = rest.split_at(*length);
                    block.push(line);
                    rest = others;
                }
                block.end();
                assert!(
                    differences == by_the_book(&bytes[..length]),
                    "{level:?} {lengths:?}"
                );
            }
        }
    }
}
