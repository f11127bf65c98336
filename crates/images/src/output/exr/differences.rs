//! The predictor of EXR's ZIP compression, applied line by line: reorders the bytes of a block and takes differences.
//!
//! This follows the "Technical Introduction to OpenEXR" and `ImfZip.cpp` of the reference library. A block has the
//! bytes of little-endian samples, row by row, and plane by plane in each row. The bytes at even positions are moved
//! before those at odd positions. Then each byte is replaced by its difference from the previous byte, plus 128.

use crate::math::{Supported, lane_kernel};

/// Added to all differences: the result for a byte that equals the previous one.
const BIAS: u8 = 128;

/// The differences of a block, to which lines are added one after the other.
pub(super) struct Differences<'a> {
    /// Differences of the bytes at even positions.
    even: &'a mut [u8],
    /// Differences of the bytes at odd positions.
    odd: &'a mut [u8],
    /// Number of pairs of bytes so far.
    count: usize,
    /// The last pair.
    previous: [u8; 2],
    level: Supported,
}

impl<'a> Differences<'a> {
    /// Differences of a block, written to `out`, which is as long as the block. The length is even, because every
    /// sample has an even number of bytes.
    pub(super) fn new(out: &'a mut [u8], level: Supported) -> Self {
        let (even, odd) = out.split_at_mut(out.len() / 2);
        Self {
            even,
            odd,
            count: 0,
            // With this value, the first byte of the block does not change
            previous: [BIAS; 2],
            level,
        }
    }

    /// Adds the next bytes of the block.
    pub(super) fn push(&mut self, line: &[u8]) {
        let (pairs, _) = line.as_chunks::<2>();
        let positions = self.count..self.count + pairs.len();
        let (even, odd) = (&mut self.even[positions.clone()], &mut self.odd[positions]);
        let ([first, ..], [.., last]) = (pairs, pairs) else {
            return;
        };
        [even[0], odd[0]] = difference(*first, self.previous);
        differences(self.level, pairs, &mut even[1..], &mut odd[1..]);
        self.count += pairs.len();
        self.previous = *last;
    }

    /// Completes the block: the first byte at an odd position follows the last one at an even position.
    pub(super) fn finish(self) {
        if let Some(first) = self.odd.first_mut() {
            *first = first.wrapping_sub(self.previous[0]).wrapping_add(BIAS);
        }
    }
}

#[inline(always)]
fn difference(pair: [u8; 2], previous: [u8; 2]) -> [u8; 2] {
    let byte = |index: usize| pair[index].wrapping_sub(previous[index]).wrapping_add(BIAS);
    [byte(0), byte(1)]
}

lane_kernel! {
    /// The differences of all `pairs` except the first.
    fn differences(pairs: &[[u8; 2]], even: &mut [u8], odd: &mut [u8]) = differences_body;
}

#[inline(always)]
fn differences_body(pairs: &[[u8; 2]], even: &mut [u8], odd: &mut [u8]) {
    let neighbours = pairs.iter().zip(&pairs[1..]);
    for ((even, odd), (previous, pair)) in even.iter_mut().zip(odd).zip(neighbours) {
        [*even, *odd] = difference(*pair, *previous);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SimdLevel;

    /// The algorithm of `ImfZip.cpp`, in two passes.
    fn reference(bytes: &[u8]) -> Vec<u8> {
        let even = bytes.iter().step_by(2);
        let reordered: Vec<u8> = even.chain(bytes.iter().skip(1).step_by(2)).copied().collect();
        let others =
            reordered.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]).wrapping_add(128));
        reordered.iter().take(1).copied().chain(others).collect()
    }

    #[test]
    fn line_predictor_equals_block_predictor() {
        let bytes: Vec<u8> = (0..4000_u32).map(|at| (at * at / 7).to_le_bytes()[0]).collect();
        for lengths in [&[4000][..], &[2, 2, 0, 4, 60, 62, 64, 66, 130, 1000], &[0], &[2]] {
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
                block.finish();
                assert!(differences == reference(&bytes[..length]), "{level:?} {lengths:?}");
            }
        }
    }
}
