//! One frame of the "LZ4 Frame Format", version 1.6.4, with all its checksums. Blocks are decoded by `lz4_flex`.
//!
//! The decoder of frames in `lz4_flex` takes the end of a file between two blocks for the end of the frame, so a file
//! that is cut short there would pass.

use std::io::{self, Read};

use xxhash_rust::xxh32::{Xxh32, xxh32};

const MAGIC: [u8; 4] = [0x04, 0x22, 0x4d, 0x18];

/// Bytes before a block that it may refer to.
const WINDOW: usize = 64 << 10;

/// The bit of a block's length that says that the block is not compressed.
const IS_STORED: u32 = 1 << 31;

/// Most bytes that a decoder of a frame takes: two blocks and the window.
pub(super) const DECODER_LEN: u64 = (8 << 20) + (64 << 10);

/// Reads the content of one frame. After its end, `reader` is behind the frame.
pub(super) struct Lz4Frame<R> {
    reader: R,
    header: FrameHeader,
    /// The window, and the block that is being returned.
    decoded: Vec<u8>,
    /// Bytes of `decoded` that have been returned.
    returned: usize,
    block: Vec<u8>,
    content: Xxh32,
    content_len: u64,
    is_ended: bool,
}

#[derive(Debug, Clone, Copy)]
struct FrameHeader {
    has_linked_blocks: bool,
    has_block_checksums: bool,
    has_content_checksum: bool,
    content_len: Option<u64>,
    most_block: usize,
}

impl<R: Read> Lz4Frame<R> {
    /// Reads the header of a frame.
    ///
    /// # Errors
    /// [`io::Error`] if it cannot be read or is damaged.
    pub(super) fn new(mut reader: R) -> io::Result<Self> {
        let header = FrameHeader::read(&mut reader)?;
        Ok(Self {
            reader,
            header,
            decoded: Vec::new(),
            returned: 0,
            block: Vec::new(),
            content: Xxh32::new(0),
            content_len: 0,
            is_ended: false,
        })
    }

    pub(super) fn into_inner(self) -> R {
        self.reader
    }

    /// The length of the content if the header states it.
    pub(super) const fn stated_len(&self) -> Option<u64> {
        self.header.content_len
    }

    /// Decodes the next block, or checks the end of the frame.
    fn next_block(&mut self) -> io::Result<()> {
        // Keep what the block may refer to
        let kept = if self.header.has_linked_blocks { self.decoded.len().min(WINDOW) } else { 0 };
        self.decoded.drain(..self.decoded.len() - kept);
        self.returned = kept;
        // Read the block
        let word = u32::from_le_bytes(array(&mut self.reader)?);
        if word == 0 {
            return self.end();
        }
        let len = usize::try_from(word & !IS_STORED).unwrap_or(usize::MAX);
        if len > self.header.most_block {
            return Err(damaged("a block is larger than the frame allows"));
        }
        self.block.resize(len, 0);
        self.reader.read_exact(&mut self.block)?;
        if self.header.has_block_checksums {
            let stated = u32::from_le_bytes(array(&mut self.reader)?);
            if stated != xxh32(&self.block, 0) {
                return Err(damaged("the checksum of a block differs"));
            }
        }
        // Decode it behind the window
        if word & IS_STORED != 0 {
            self.decoded.extend_from_slice(&self.block);
        } else {
            self.decoded.resize(kept + self.header.most_block, 0);
            let (window, output) = self.decoded.split_at_mut(kept);
            let written = lz4_flex::block::decompress_into_with_dict(&self.block, output, window)
                .map_err(|error| damaged(&error.to_string()))?;
            self.decoded.truncate(kept + written);
        }
        let new = self.decoded.get(kept..).unwrap_or_default();
        self.content_len += new.len() as u64;
        if self.header.has_content_checksum {
            self.content.update(new);
        }
        Ok(())
    }

    fn end(&mut self) -> io::Result<()> {
        if self.header.has_content_checksum {
            let stated = u32::from_le_bytes(array(&mut self.reader)?);
            if stated != self.content.digest() {
                return Err(damaged("the checksum of the content differs"));
            }
        }
        if self.header.content_len.is_some_and(|len| len != self.content_len) {
            return Err(damaged("the length of the content is not the stated one"));
        }
        self.is_ended = true;
        Ok(())
    }
}

impl<R: Read> Read for Lz4Frame<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        while self.returned == self.decoded.len() && !self.is_ended {
            self.next_block()?;
        }
        let rest = self.decoded.get(self.returned..).unwrap_or_default();
        let len = rest.len().min(to.len());
        to[..len].copy_from_slice(&rest[..len]);
        self.returned += len;
        Ok(len)
    }
}

impl FrameHeader {
    fn read(reader: &mut impl Read) -> io::Result<Self> {
        if array(reader)? != MAGIC {
            return Err(damaged("no LZ4 frame begins here"));
        }
        // Descriptor: flags, block size, perhaps the length of the content and a dictionary, one byte of checksum
        let mut descriptor = array::<2>(reader)?.to_vec();
        let [flags, size] = descriptor[..] else {
            unreachable!("two bytes were read");
        };
        if flags >> 6 != 1 || flags & 2 != 0 || size & 0x8f != 0 {
            return Err(damaged("flags of an unknown version"));
        }
        let content_len = match flags & 8 {
            0 => None,
            _ => {
                let bytes = array::<8>(reader)?;
                descriptor.extend(bytes);
                Some(u64::from_le_bytes(bytes))
            }
        };
        if flags & 1 != 0 {
            return Err(damaged("a dictionary is needed; compress without one"));
        }
        let [checksum] = array(reader)?;
        if u32::from(checksum) != (xxh32(&descriptor, 0) >> 8) & 0xff {
            return Err(damaged("the checksum of the header differs"));
        }
        let most_block = match size >> 4 {
            number @ 4..=7 => 1 << (8 + 2 * number),
            _ => return Err(damaged("an unknown size of blocks")),
        };
        Ok(Self {
            has_linked_blocks: flags & 0x20 == 0,
            has_block_checksums: flags & 0x10 != 0,
            has_content_checksum: flags & 4 != 0,
            content_len,
            most_block,
        })
    }
}

fn array<const N: usize>(reader: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    reader.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn damaged(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}
