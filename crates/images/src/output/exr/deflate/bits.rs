//! Writes bits into bytes, least significant bit first.

/// Appends numbers of a few bits to a vector of bytes.
pub(super) struct BitWriter<'a> {
    bytes: &'a mut Vec<u8>,
    /// Position of the next byte. Bytes beyond it are reserved space.
    at: usize,
    /// Bits that are not in `bytes` yet.
    bits: u64,
    /// Number of these bits.
    count: u32,
}

impl<'a> BitWriter<'a> {
    pub(super) fn new(bytes: &'a mut Vec<u8>) -> Self {
        let at = bytes.len();
        Self { bytes, at, bits: 0, count: 0 }
    }

    /// Number of complete bytes so far.
    pub(super) fn byte_len(&self) -> usize {
        self.at
    }

    /// Reserves space for `bits` more bits.
    pub(super) fn reserve(&mut self, bits: u64) {
        let bytes = usize::try_from(bits / 8).expect("blocks fit into memory");
        // `flush` writes eight bytes at once, and up to seven bits may be pending
        self.bytes.resize(self.at + bytes + 16, 0);
    }

    /// Appends the lowest `count` bits of `value`; its other bits must be 0. At most 56 bits may be appended between
    /// two calls of [`Self::flush`].
    #[inline(always)]
    pub(super) fn put(&mut self, value: u64, count: u32) {
        self.bits |= value << self.count;
        self.count += count;
    }

    /// Moves complete bytes to the vector, which must have reserved space for them.
    #[inline(always)]
    pub(super) fn flush(&mut self) {
        self.bytes[self.at..self.at + 8].copy_from_slice(&self.bits.to_le_bytes());
        let whole = self.count / 8;
        self.at += whole as usize;
        self.bits >>= whole * 8;
        self.count %= 8;
    }

    /// Fills up the last byte with zero bits, and removes the reserved space.
    pub(super) fn align(&mut self) {
        self.reserve(0);
        self.count = self.count.next_multiple_of(8);
        self.flush();
        self.bytes.truncate(self.at);
    }

    /// Appends whole bytes, after [`Self::align`].
    pub(super) fn extend(&mut self, bytes: &[u8]) {
        debug_assert_eq!(self.count, 0, "aligned before");
        self.bytes.truncate(self.at);
        self.bytes.extend_from_slice(bytes);
        self.at = self.bytes.len();
    }
}
