//! Bits into bytes, the lowest first.

/// Writes numbers of a few bits behind the bytes of a vector.
pub(super) struct BitWriter<'a> {
    bytes: &'a mut Vec<u8>,
    /// Where the next byte goes: what lies beyond is room.
    at: usize,
    /// Bits that are not in `bytes` yet.
    bits: u64,
    /// How many.
    count: u32,
}

impl<'a> BitWriter<'a> {
    pub(super) fn new(bytes: &'a mut Vec<u8>) -> Self {
        let at = bytes.len();
        Self {
            bytes,
            at,
            bits: 0,
            count: 0,
        }
    }

    /// Whole bytes so far.
    pub(super) fn byte_len(&self) -> usize {
        self.at
    }

    /// Makes room for so many further bits.
    pub(super) fn reserve(&mut self, bits: u64) {
        let bytes = usize::try_from(bits / 8).expect("blocks fit into memory");
        // Eight bytes are written at once, and some bits may wait.
        self.bytes.resize(self.at + bytes + 16, 0);
    }

    /// Appends the lowest `count` bits of `value`, which has no others. No more than 56 may be appended between calls
    /// of [`Self::flush`].
    #[inline(always)]
    pub(super) fn put(&mut self, value: u64, count: u32) {
        self.bits |= value << self.count;
        self.count += count;
    }

    /// Moves whole bytes out; there must be room for them.
    #[inline(always)]
    pub(super) fn flush(&mut self) {
        self.bytes[self.at..self.at + 8].copy_from_slice(&self.bits.to_le_bytes());
        let whole = self.count / 8;
        self.at += whole as usize;
        self.bits >>= whole * 8;
        self.count %= 8;
    }

    /// Fills the last byte with zeros, and gives back the room.
    pub(super) fn align(&mut self) {
        self.reserve(0);
        self.count = self.count.next_multiple_of(8);
        self.flush();
        self.bytes.truncate(self.at);
    }

    /// Appends whole bytes behind those that [`Self::align`] has made whole.
    pub(super) fn extend(&mut self, bytes: &[u8]) {
        debug_assert_eq!(self.count, 0, "aligned before");
        self.bytes.truncate(self.at);
        self.bytes.extend_from_slice(bytes);
        self.at = self.bytes.len();
    }
}
