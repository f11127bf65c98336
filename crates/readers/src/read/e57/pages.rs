//! The pages of a file. Each ends with a checksum of its other bytes, which are the content of the file.

use crate::read::CUT_SHORT;
use crate::read::numbers::NumberReader;
use spherule_frame::{Endian, ParseError};

pub(super) const MAGIC: &[u8] = b"ASTM-E57";
/// Bytes of the header.
const HEADER: usize = 48;
/// Bytes of a checksum.
const CHECKSUM: usize = 4;
/// Valid sizes of pages. All known programs write 1024.
const SIZES: std::ops::RangeInclusive<usize> = 64..=1 << 20;

/// The bytes of a file in its pages.
pub(super) struct Pages<'a> {
    bytes: &'a [u8],
    size: usize,
}

/// Where the XML part of a file is.
pub(super) struct XmlPlace {
    /// In the content.
    pub(super) at: usize,
    pub(super) len: usize,
}

impl<'a> Pages<'a> {
    /// The pages of a file, and the place of its XML.
    pub(super) fn open(bytes: &'a [u8]) -> Result<(Self, XmlPlace), ParseError> {
        if !bytes.starts_with(MAGIC) {
            return Err(ParseError::malformed(0, "an E57 file begins with ASTM-E57"));
        }
        if bytes.len() < HEADER {
            let what = format!("an E57 header has {HEADER} bytes: {CUT_SHORT}");
            return Err(ParseError::malformed(bytes.len(), what));
        }
        let number = |at: usize| NumberReader::new(bytes, at, Endian::Little);
        let major = number(8).i32()?;
        if major != 1 {
            return Err(ParseError::unsupported(format!("E57 version {major}; version 1 is read")));
        }
        let word =
            |at: usize| number(at).u64().map(|word| usize::try_from(word).unwrap_or(usize::MAX));
        let size = word(40)?;
        if !SIZES.contains(&size) {
            return Err(ParseError::malformed(40, format!("pages of {size} bytes")));
        }
        let pages = Self { bytes, size };
        let place = XmlPlace { at: pages.content_at(word(24)?), len: word(32)? };
        Ok((pages, place))
    }

    /// Bytes of the file.
    pub(super) const fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The place in the content of a place in the file.
    pub(super) const fn content_at(&self, place: usize) -> usize {
        let (page, inside) = (place / self.size, place % self.size);
        let room = self.size - CHECKSUM;
        page * room + if inside < room { inside } else { room }
    }

    /// The place in the file of a place in the content.
    pub(super) const fn place_of(&self, at: usize) -> usize {
        let room = self.size - CHECKSUM;
        let place = (at / room).saturating_mul(self.size).saturating_add(at % room);
        if place < self.bytes.len() { place } else { self.bytes.len() }
    }

    /// Replaces `found` by the `len` bytes of the content from `at` on.
    pub(super) fn read(
        &self,
        at: usize,
        len: usize,
        found: &mut Vec<u8>,
    ) -> Result<(), ParseError> {
        found.clear();
        let room = self.size - CHECKSUM;
        let end = at.saturating_add(len);
        if end.div_ceil(room).saturating_mul(self.size) > self.bytes.len() {
            let place = self.place_of(at);
            let what = format!("{len} bytes expected here: {CUT_SHORT}");
            return Err(ParseError::malformed(place, what));
        }
        let mut at = at;
        while at < end {
            let page = at / room;
            let (content, checksum) = self.bytes[page * self.size..][..self.size].split_at(room);
            if crc32c(content).to_be_bytes() != checksum {
                let what = format!("the checksum of page {page} is wrong; copy the file again");
                return Err(ParseError::malformed(page * self.size, what));
            }
            let inside = at % room..room.min(at % room + end - at);
            at += inside.len();
            found.extend(&content[inside]);
        }
        Ok(())
    }
}

/// Checksum of `bytes` (CRC-32C). It is short, and no other part of the program needs this polynomial.
#[expect(clippy::cast_possible_truncation, reason = "bytes, and places in a table of 256")]
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut index = 0;
        while index < 256 {
            let (mut value, mut bit) = (index as u32, 0);
            while bit < 8 {
                value = (value >> 1) ^ ((value & 1) * 0x82f6_3b78);
                bit += 1;
            }
            table[index] = value;
            index += 1;
        }
        table
    };
    let step = |sum: u32, byte: &u8| TABLE[(sum as u8 ^ byte) as usize] ^ (sum >> 8);
    !bytes.iter().fold(u32::MAX, step)
}
