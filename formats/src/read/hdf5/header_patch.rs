//! Headers of virtual data sets, which `hdf5-reader` refuses as a whole: shown to it with a layout that it knows.
//!
//! A virtual data set has its elements in other data sets. Its data layout message has class 3 and says where the list
//! of these is. In what the library reads, the message says that the elements are in the header, and that there are
//! none. All else of the header stays as it is. Layout of headers: HDF5 File Format Specification 3.0, IV.A.1 and
//! IV.A.2.i.

use std::ops::Range;

use hdf5_reader::checksum::jenkins_lookup3;
use hdf5_reader::error::Error;
use hdf5_reader::io::Cursor;

/// Data layout, and continuation of a header.
const LAYOUT: u16 = 0x08;
const CONTINUATION: u16 = 0x10;
/// Class of the layout of a virtual data set.
const VIRTUAL: u8 = 3;
/// Most parts of a header. Simulations have one or two.
const MOST_BLOCKS: usize = 1024;

/// Sizes of numbers in a file, and where its addresses begin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Addressing {
    pub(super) offset_size: u8,
    pub(super) length_size: u8,
    /// Byte of the file at which address 0 is.
    pub(super) base: u64,
}

/// Where the list of the parts of a virtual data set is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ListPlace {
    /// Address of the collection of the global heap.
    pub(super) collection: u64,
    /// Index of the object in it.
    pub(super) index: u16,
}

/// Bytes of a file that are shown as others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Patch {
    start: u64,
    bytes: Vec<u8>,
}

impl Patch {
    /// Changes the part of it that is in `bytes`, which begin at byte `start` of the file.
    pub(super) fn apply(&self, start: u64, bytes: &mut [u8]) {
        for (place, byte) in (self.start..).zip(&self.bytes) {
            let index = place
                .checked_sub(start)
                .and_then(|i| usize::try_from(i).ok());
            if let Some(to) = index.and_then(|index| bytes.get_mut(index)) {
                *to = *byte;
            }
        }
    }

    /// Whether it changes bytes of `range`.
    pub(super) fn touches(&self, range: &Range<u64>) -> bool {
        self.start < range.end && range.start < self.start + self.bytes.len() as u64
    }
}

/// A part of a header: messages, and a checksum after them in version 2.
struct Block {
    start: u64,
    messages: Range<u64>,
    has_checksum: bool,
}

/// Finds the layout message of the virtual data set whose header is at `address` of the file `bytes`: where its list
/// is, and what to show instead of the message; `None` if there is no such message.
///
/// # Errors
/// [`Error`] if the header is damaged.
pub(super) fn virtual_layout(
    bytes: &[u8],
    address: u64,
    addressing: Addressing,
) -> Result<Option<(ListPlace, Vec<Patch>)>, Error> {
    let start = address.saturating_add(addressing.base);
    let mut cursor = Cursor::new(bytes);
    cursor.set_position(start);
    let is_second = cursor.peek_bytes(4)? == b"OHDR";
    let (first, has_order) = match is_second {
        true => second_version(&mut cursor, start)?,
        false => (first_version(&mut cursor, start)?, false),
    };
    let mut blocks = vec![first];
    let mut next = 0;
    while let Some(block) = blocks.get(next) {
        let (start, end, has_checksum) = (block.start, block.messages.end, block.has_checksum);
        cursor.set_position(block.messages.start);
        let head_len = if !is_second {
            8
        } else {
            4 + 2 * u64::from(has_order)
        };
        while cursor.position() + head_len <= end {
            let (kind, len) = match is_second {
                true => {
                    let kind = u16::from(cursor.read_u8()?);
                    (kind, cursor.read_u16_le()?)
                }
                false => (cursor.read_u16_le()?, cursor.read_u16_le()?),
            };
            cursor.skip(if !is_second {
                4
            } else {
                1 + 2 * usize::from(has_order)
            })?;
            let place = cursor.position();
            let data = cursor.read_bytes(usize::from(len))?;
            if kind == LAYOUT && data.get(1) == Some(&VIRTUAL) {
                let mut fields = Cursor::new(&data[2..]);
                let collection = fields.read_offset(addressing.offset_size)?;
                let index = u16::try_from(fields.read_u32_le()?);
                let index =
                    index.map_err(|_| Error::InvalidData("heap index above 65535".into()))?;
                // Class 0, and a length of 0 in two bytes
                let mut patches = vec![Patch {
                    start: place + 1,
                    bytes: vec![0; 3],
                }];
                if has_checksum {
                    patches.push(checksum(bytes, start..end, &patches[0])?);
                }
                return Ok(Some((ListPlace { collection, index }, patches)));
            }
            if kind == CONTINUATION && blocks.len() < MOST_BLOCKS {
                let mut fields = Cursor::new(data);
                let start = fields.read_offset(addressing.offset_size)?;
                let start = start.saturating_add(addressing.base);
                let len = fields.read_length(addressing.length_size)?;
                let end = start.saturating_add(len);
                blocks.push(match is_second {
                    true => Block {
                        start,
                        messages: start.saturating_add(4)..end.saturating_sub(4),
                        has_checksum: true,
                    },
                    false => Block {
                        start,
                        messages: start..end,
                        has_checksum: false,
                    },
                });
            }
        }
        next += 1;
    }
    Ok(None)
}

/// The first part of a header of version 1 that begins at byte `start`.
fn first_version(cursor: &mut Cursor<'_>, start: u64) -> Result<Block, Error> {
    // Version, reserved byte, number of messages, number of references
    cursor.skip(8)?;
    let len = u64::from(cursor.read_u32_le()?);
    cursor.skip(4)?;
    let first = cursor.position();
    Ok(Block {
        start,
        messages: first..first + len,
        has_checksum: false,
    })
}

/// The first part of a header of version 2 that begins at byte `start`, and whether messages have their order.
fn second_version(cursor: &mut Cursor<'_>, start: u64) -> Result<(Block, bool), Error> {
    // Signature and version
    cursor.skip(5)?;
    let flags = cursor.read_u8()?;
    let times = if flags & 0x20 != 0 { 16 } else { 0 };
    let limits = if flags & 0x10 != 0 { 4 } else { 0 };
    cursor.skip(times + limits)?;
    let len = cursor.read_uvar(1 << (flags & 3))?;
    let first = cursor.position();
    let block = Block {
        start,
        messages: first..first.saturating_add(len),
        has_checksum: true,
    };
    Ok((block, flags & 4 != 0))
}

/// The checksum after `range` as it is with `patch`.
///
/// # Errors
/// [`Error`] if it is wrong as it is without.
fn checksum(bytes: &[u8], range: Range<u64>, patch: &Patch) -> Result<Patch, Error> {
    let mut cursor = Cursor::new(bytes);
    cursor.set_position(range.start);
    let len = usize::try_from(range.end.saturating_sub(range.start)).unwrap_or(usize::MAX);
    let mut block = cursor.read_bytes(len)?.to_vec();
    if cursor.read_u32_le()? != jenkins_lookup3(&block) {
        return Err(Error::InvalidData("wrong checksum of a header".into()));
    }
    patch.apply(range.start, &mut block);
    Ok(Patch {
        start: range.end,
        bytes: jenkins_lookup3(&block).to_le_bytes().to_vec(),
    })
}
