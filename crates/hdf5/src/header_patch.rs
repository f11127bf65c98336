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
const MAX_BLOCKS: usize = 1024;

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
            let index = place.checked_sub(start).and_then(|i| usize::try_from(i).ok());
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

/// How messages of a header begin.
#[derive(Debug, Clone, Copy)]
enum Version {
    First,
    /// Messages may have two bytes for their order.
    Second {
        has_order: bool,
    },
}

impl Version {
    /// Bytes before the data of a message.
    fn head_len(self) -> u64 {
        match self {
            Self::First => 8,
            Self::Second { has_order } => 4 + 2 * u64::from(has_order),
        }
    }

    /// Reads the type of a message and the length of its data, which follows.
    fn read_head(self, cursor: &mut Cursor<'_>) -> Result<(u16, usize), Error> {
        let (kind, len, others) = match self {
            Self::First => (cursor.read_u16_le()?, cursor.read_u16_le()?, 4),
            Self::Second { has_order } => {
                let kind = u16::from(cursor.read_u8()?);
                (kind, cursor.read_u16_le()?, 1 + 2 * usize::from(has_order))
            }
        };
        cursor.skip(others)?;
        Ok((kind, usize::from(len)))
    }
}

/// A part of a header: messages, and in version 2 a checksum after them.
struct Block {
    start: u64,
    messages: Range<u64>,
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
    let (version, first) = match cursor.peek_bytes(4)? {
        b"OHDR" => second_version(&mut cursor, start)?,
        _ => (Version::First, first_version(&mut cursor, start)?),
    };
    let mut blocks = vec![first];
    let mut next = 0;
    while let Some(block) = blocks.get(next) {
        let (start, end) = (block.start, block.messages.end);
        cursor.set_position(block.messages.start);
        while cursor.position() + version.head_len() <= end {
            let (kind, len) = version.read_head(&mut cursor)?;
            let place = cursor.position();
            let data = cursor.read_bytes(len)?;
            if kind == LAYOUT && data.get(1) == Some(&VIRTUAL) {
                let list = list_place(&data[2..], addressing)?;
                // Class 0, and a length of 0 in two bytes
                let mut patches = vec![Patch { start: place + 1, bytes: vec![0; 3] }];
                if matches!(version, Version::Second { .. }) {
                    patches.push(checksum(bytes, start..end, &patches[0])?);
                }
                return Ok(Some((list, patches)));
            }
            if kind == CONTINUATION && blocks.len() < MAX_BLOCKS {
                blocks.push(continuation(data, version, addressing)?);
            }
        }
        next += 1;
    }
    Ok(None)
}

/// The place of the list in a layout message, from the third byte of its data on.
fn list_place(fields: &[u8], addressing: Addressing) -> Result<ListPlace, Error> {
    let mut fields = Cursor::new(fields);
    let collection = fields.read_offset(addressing.offset_size)?;
    let index = u16::try_from(fields.read_u32_le()?);
    let index = index.map_err(|_| Error::InvalidData("heap index above 65535".into()))?;
    Ok(ListPlace { collection, index })
}

/// The part of a header that the `data` of a continuation message refers to.
fn continuation(data: &[u8], version: Version, addressing: Addressing) -> Result<Block, Error> {
    let mut fields = Cursor::new(data);
    let start = fields.read_offset(addressing.offset_size)?.saturating_add(addressing.base);
    let end = start.saturating_add(fields.read_length(addressing.length_size)?);
    let messages = match version {
        Version::First => start..end,
        // A signature before them
        Version::Second { .. } => start.saturating_add(4)..end.saturating_sub(4),
    };
    Ok(Block { start, messages })
}

/// The first part of a header of version 1 that begins at byte `start`.
fn first_version(cursor: &mut Cursor<'_>, start: u64) -> Result<Block, Error> {
    // Version, reserved byte, number of messages, number of references
    cursor.skip(8)?;
    let len = u64::from(cursor.read_u32_le()?);
    cursor.skip(4)?;
    let first = cursor.position();
    let messages = first..first + len;
    Ok(Block { start, messages })
}

/// How messages begin in a header of version 2 that begins at byte `start`, and its first part.
fn second_version(cursor: &mut Cursor<'_>, start: u64) -> Result<(Version, Block), Error> {
    // Signature and version
    cursor.skip(5)?;
    let flags = cursor.read_u8()?;
    let times = if flags & 0x20 != 0 { 16 } else { 0 };
    let limits = if flags & 0x10 != 0 { 4 } else { 0 };
    cursor.skip(times + limits)?;
    let len = cursor.read_uvar(1 << (flags & 3))?;
    let first = cursor.position();
    let messages = first..first.saturating_add(len);
    let has_order = flags & 4 != 0;
    Ok((Version::Second { has_order }, Block { start, messages }))
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
    Ok(Patch { start: range.end, bytes: jenkins_lookup3(&block).to_le_bytes().to_vec() })
}
