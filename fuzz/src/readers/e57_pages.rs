//! The pages of E57, for the fuzz target and the damaged files of the suite, which includes this file.

/// Bytes of a page without the checksum behind them.
const PAGE: usize = 1020;

/// `content` in pages with checksums (CRC-32C).
pub(super) fn sealed(mut content: Vec<u8>) -> Vec<u8> {
    content.resize(content.len().next_multiple_of(PAGE), 0);
    let bit = |sum: u32| (sum >> 1) ^ if sum & 1 == 1 { 0x82f6_3b78 } else { 0 };
    let byte = |sum: u32, byte: &u8| (0..8).fold(sum ^ u32::from(*byte), |sum, _| bit(sum));
    let seal = |page: &[u8]| [page, &(!page.iter().fold(u32::MAX, byte)).to_be_bytes()].concat();
    content.chunks(PAGE).flat_map(seal).collect()
}
