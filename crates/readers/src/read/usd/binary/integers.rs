//! Compressed blocks of binary USD files: LZ4, and lists of integers as differences of 0 to 8 bytes.
//!
//! A list of integers begins with the most frequent difference. Codes of two bits follow, one for each integer: 0
//! stands for that difference, 1 to 3 for one of a quarter, half and all bytes of the type, which follow all codes.
//! After the layout that OpenUSD documents in `integerCoding.cpp` and `fastCompression.h`.

use spherule_frame::ParseError;

/// LZ4 cannot make a block that much shorter than its content.
pub(super) const RATIO: usize = 256;

/// Least content that a block may have, whatever its length.
const SLACK: usize = 64;

/// Decompresses `packed`, which begins at byte `at` of the file, to at most `most` bytes.
///
/// # Errors
/// [`ParseError::Malformed`] if it is damaged or has more.
pub(super) fn unpacked(packed: &[u8], most: usize, at: usize) -> Result<Vec<u8>, ParseError> {
    let damaged = || ParseError::malformed(at, "the compressed block here is damaged");
    let (chunk_count, blocks) = packed.split_first().ok_or_else(damaged)?;
    let most = most.min(packed.len().saturating_mul(RATIO).saturating_add(SLACK));
    let mut content = vec![0; most];
    if *chunk_count == 0 {
        let len = lz4_flex::block::decompress_into(blocks, &mut content).map_err(|_| damaged())?;
        content.truncate(len);
        return Ok(content);
    }
    // Several blocks with their lengths, of a content of more than 2 GiB
    let (mut rest, mut len) = (blocks, 0);
    for _ in 0..*chunk_count {
        let (head, after) = rest.split_first_chunk().ok_or_else(damaged)?;
        let block_len = usize::try_from(i32::from_le_bytes(*head)).map_err(|_| damaged())?;
        let (block, after) = after.split_at_checked(block_len).ok_or_else(damaged)?;
        let to = content.get_mut(len..).unwrap_or_default();
        len += lz4_flex::block::decompress_into(block, to).map_err(|_| damaged())?;
        rest = after;
    }
    content.truncate(len);
    Ok(content)
}

/// An integer type of compressed lists.
pub(super) trait Coded: Copy {
    /// Bytes of a number.
    const LEN: usize;
    /// The number whose low bits are `bits`.
    fn from_bits(bits: u64) -> Self;
}

impl Coded for u32 {
    const LEN: usize = 4;

    fn from_bits(bits: u64) -> Self {
        let [a, b, c, d, ..] = bits.to_le_bytes();
        Self::from_le_bytes([a, b, c, d])
    }
}

impl Coded for u64 {
    const LEN: usize = 8;

    fn from_bits(bits: u64) -> Self {
        bits
    }
}

/// Most bytes of `count` integers before their LZ4 compression.
pub(super) const fn coded_len<T: Coded>(count: usize) -> usize {
    T::LEN + count.div_ceil(4) + count.saturating_mul(T::LEN)
}

/// Whether a block of `packed_len` bytes can have `count` integers.
pub(super) const fn can_have(packed_len: usize, count: usize) -> bool {
    count.div_ceil(4) <= packed_len.saturating_mul(RATIO).saturating_add(SLACK)
}

/// Decodes `count` integers; `None` if `coded` has fewer.
pub(super) fn decoded<T: Coded>(coded: &[u8], count: usize) -> Option<Vec<T>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let (common, rest) = coded.split_at_checked(T::LEN)?;
    let common = signed(common);
    let (codes, mut rest) = rest.split_at_checked(count.div_ceil(4))?;
    let mut numbers = Vec::with_capacity(count);
    let mut number = 0_u64;
    for index in 0..count {
        let code = codes.get(index / 4)? >> (2 * (index % 4)) & 3;
        let difference = match code {
            0 => common,
            code => {
                let len = T::LEN >> (3 - code);
                let (bytes, after) = rest.split_at_checked(len)?;
                rest = after;
                signed(bytes)
            }
        };
        number = number.wrapping_add(difference);
        numbers.push(T::from_bits(number));
    }
    Some(numbers)
}

/// Extends a little-endian integer of 1, 2, 4 or 8 bytes by its sign.
fn signed(bytes: &[u8]) -> u64 {
    let is_negative = bytes.last().is_some_and(|byte| byte & 0x80 != 0);
    let mut all = [if is_negative { 0xff } else { 0 }; 8];
    for (to, from) in all.iter_mut().zip(bytes) {
        *to = *from;
    }
    u64::from_le_bytes(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_are_sums_of_differences() {
        // Worked by hand: 123 is 123 more than 0 (one byte), 1 is the common difference
        let numbers = [123_u32, 124, 125, 100_125, 100_125, 100_126, 100_126];
        let mut coded = 1_i32.to_le_bytes().to_vec();
        coded.extend([0b11_00_00_01, 0b01_00_01]);
        coded.push(123);
        coded.extend(100_000_i32.to_le_bytes());
        coded.extend([0, 0]);
        assert_eq!(decoded::<u32>(&coded, 7).as_deref(), Some(&numbers[..]));
        for len in 0..coded.len() {
            assert_eq!(decoded::<u32>(&coded[..len], 7), None, "{len}");
        }
        // 64 bits: codes stand for 2, 4 and 8 bytes
        let mut coded = (-5_i64).to_le_bytes().to_vec();
        coded.push(0b11_10_01_00);
        coded.extend((-300_i16).to_le_bytes());
        coded.extend(70_000_i32.to_le_bytes());
        coded.extend((1_i64 << 40).to_le_bytes());
        let expected = [-5_i64, -305, 69_695, 69_695 + (1 << 40)];
        let found = decoded::<u64>(&coded, 4).expect("four numbers");
        assert_eq!(found, expected.map(i64::cast_unsigned));
        assert_eq!(decoded::<u64>(&[], 0), Some(Vec::new()));
    }

    #[test]
    fn blocks_are_decompressed_in_one_piece_or_several() {
        let content = b"particles particles particles particles".repeat(3);
        let block = lz4_flex::block::compress(&content);
        let one = [&[0][..], &block].concat();
        assert_eq!(unpacked(&one, content.len(), 7), Ok(content.clone()));
        assert!(unpacked(&one, content.len() - 1, 7).is_err());
        let length = u8::try_from(block.len()).expect("short");
        let two = [&[2, length, 0, 0, 0][..], &block, &[length, 0, 0, 0], &block].concat();
        assert_eq!(unpacked(&two, 1000, 7), Ok(content.repeat(2)));
        for len in 0..two.len() {
            assert!(unpacked(&two[..len], 1000, 7).is_err(), "{len}");
        }
    }
}
