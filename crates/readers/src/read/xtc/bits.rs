//! Integers in a stream of bits, as `.xtc` packs them.

use spherule_frame::ParseError;

/// Bits from front to back, the most significant of a byte first.
#[derive(Debug)]
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    /// Offset of `bytes` in the file.
    start: usize,
    /// Bits that were read.
    at: usize,
}

/// Three numbers that are packed as the digits of one, whose bases are their ranges.
#[derive(Debug, Clone, Copy)]
pub(super) struct PackedTriple {
    /// How many values each of the numbers has; at least 1.
    ranges: [u32; 3],
    /// Bits of the packed number.
    bits: u32,
}

impl PackedTriple {
    /// Numbers below `ranges` in as many bits as their product has.
    pub(super) fn new(ranges: [u32; 3]) -> Self {
        let product = ranges.iter().map(|range| u128::from(*range));
        let bits = u128::BITS - product.product::<u128>().leading_zeros();
        Self { ranges, bits }
    }

    /// Three numbers below `range` in `bits`.
    pub(super) const fn cube(range: u32, bits: u32) -> Self {
        Self { ranges: [range; 3], bits }
    }
}

impl<'a> BitReader<'a> {
    /// The bits of `bytes`, which are at `start` in the file.
    pub(super) const fn new(bytes: &'a [u8], start: usize) -> Self {
        Self { bytes, start, at: 0 }
    }

    /// The next `count` bits at the top of a word, up to 120.
    #[inline]
    fn window(&mut self, count: u32) -> Result<u128, ParseError> {
        let (byte, shift) = (self.at / 8, self.at % 8);
        self.at += count as usize;
        if self.at > 8 * self.bytes.len() {
            let what = "the compressed positions end before the last atom: the file is damaged";
            return Err(ParseError::malformed(self.start + self.bytes.len(), what));
        }
        let rest = self.bytes.get(byte..).unwrap_or_default();
        let word = match rest.first_chunk() {
            Some(word) => u128::from_be_bytes(*word),
            None => {
                let mut word = [0; 16];
                word[..rest.len()].copy_from_slice(rest);
                u128::from_be_bytes(word)
            }
        };
        Ok(word << shift)
    }

    /// A number of `count` bits, up to 32.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the end of the bits.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "up to 32 bits")]
    pub(super) fn number(&mut self, count: u32) -> Result<u32, ParseError> {
        let window = self.window(count)?;
        Ok(if count == 0 { 0 } else { (window >> (u128::BITS - count)) as u32 })
    }

    /// Three numbers. Their packed number is stored with its least significant byte first.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the end of the bits.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "remainders of u32, and a wrapped quotient as in GROMACS"
    )]
    pub(super) fn triple(&mut self, packed: PackedTriple) -> Result<[u32; 3], ParseError> {
        let window = self.window(packed.bits)?;
        let whole = packed.bits / 8 * 8;
        let rest = packed.bits % 8;
        // The last byte is not full: its bits are the lowest of it.
        let swapped = window.swap_bytes() & !(u128::MAX << whole);
        let last = if rest == 0 { 0 } else { (window << whole) >> (u128::BITS - rest) << whole };
        let number = swapped | last;
        let [_, y, z] = packed.ranges.map(|range| range.max(1));
        Ok(match u64::try_from(number) {
            Ok(number) => {
                let (y, z) = (u64::from(y), u64::from(z));
                let high = number / z;
                [(high / y) as u32, (high % y) as u32, (number % z) as u32]
            }
            Err(_) => {
                let (y, z) = (u128::from(y), u128::from(z));
                let high = number / z;
                [(high / y) as u32, (high % y) as u32, (number % z) as u32]
            }
        })
    }
}
