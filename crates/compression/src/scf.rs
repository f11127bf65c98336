//! Houdini's "seekable compressed format" (`.sc`, as in `.bgeo.sc`): frames of Blosc one after another, then an index.
//!
//! The header is `scf1`, the length of the metadata, and the metadata. The index has the end of each frame except the
//! last, counted from the first one, the length of the content of a frame, and that of the last one. Its length and
//! `1fcs` are the end of the file. All numbers are big-endian and have 64 bits. After the headers `UT_SCFWriter.h`,
//! `UT_CompressedBlockIndex.h` and `UT_BloscCompressionFilter.h` of the Houdini Development Kit, and what open readers
//! of such files expect.

use std::io::{self, BufRead, Read};

use super::blosc::{BlockDecoder, FrameHeader, HEADER, damaged};

pub(super) const MAGIC: &[u8] = b"scf1";
const END_MAGIC: &[u8] = b"1fcs";

/// Length of the index, and the magic after it.
const FOOTER: u64 = 12;

/// The part of the end that is checked: two lengths of content, and the footer.
const END_LEN: usize = 28;

/// Reads the content of a file. After its end, `reader` is at the end of the file.
pub(super) struct ScfReader<R> {
    reader: R,
    /// The current frame.
    frame: Option<FrameHeader>,
    /// Blocks of it that have been decoded.
    block_count: usize,
    decoder: BlockDecoder,
    /// The block that is being returned.
    block: Vec<u8>,
    /// Bytes of it that have been returned.
    returned: usize,
    /// Bytes of the content of the longest frame.
    most_frame: usize,
    /// Bytes that decoding a frame takes.
    decoder_len: u64,
    content_len: u64,
    is_ended: bool,
}

impl<R: BufRead> ScfReader<R> {
    /// Reads the header and the first frame, if that can be decoded in `most` bytes.
    ///
    /// # Errors
    /// [`io::Error`] if it cannot be read or is damaged; [`io::ErrorKind::OutOfMemory`] if `most` is too small.
    pub(super) fn new(mut reader: R, most: u64) -> io::Result<Self> {
        let mut header = [0; 12];
        reader.read_exact(&mut header)?;
        let [magic @ .., _, _, _, _, _, _, _, _] = &header;
        let [_, _, _, _, metadata_len @ ..] = header;
        if magic != MAGIC {
            return Err(damaged("no file of this format begins here"));
        }
        let metadata_len = u64::from_be_bytes(metadata_len);
        let skipped = io::copy(&mut reader.by_ref().take(metadata_len), &mut io::sink())?;
        if skipped < metadata_len {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut this = Self {
            reader,
            frame: None,
            block_count: 0,
            decoder: BlockDecoder::default(),
            block: Vec::new(),
            returned: 0,
            most_frame: usize::MAX,
            decoder_len: 0,
            content_len: 0,
            is_ended: false,
        };
        this.next_frame(most)?;
        this.most_frame = this.frame.map_or(0, |frame| frame.len);
        this.decoder_len = this.frame.map_or(0, |frame| frame.decoder_len());
        Ok(this)
    }

    pub(super) fn into_inner(self) -> R {
        self.reader
    }

    /// Bytes that the decoder holds beside its output.
    pub(super) const fn decoder_len(&self) -> u64 {
        self.decoder_len
    }

    /// Decodes the next block, or checks the end of the file.
    fn next_block(&mut self) -> io::Result<()> {
        self.returned = 0;
        self.block.clear();
        let Some(frame) = self.frame else {
            return Ok(());
        };
        if self.block_count == frame.block_count() {
            return self.next_frame(self.decoder_len);
        }
        self.decoder.decode(&frame, self.block_count, &mut self.block)?;
        self.block_count += 1;
        self.content_len += self.block.len() as u64;
        Ok(())
    }

    /// Reads the next frame, or the index. Decoding the frame may take `most` bytes.
    fn next_frame(&mut self, most: u64) -> io::Result<()> {
        let mut header = Vec::with_capacity(HEADER);
        self.reader.by_ref().take(HEADER as u64).read_to_end(&mut header)?;
        self.frame = FrameHeader::parse(&header);
        self.block_count = 0;
        let Some(frame) = self.frame else {
            self.is_ended = true;
            return self.check_end(header);
        };
        if frame.len > self.most_frame {
            return Err(damaged("a frame is longer than the first one"));
        }
        if frame.decoder_len() > most {
            return Err(io::ErrorKind::OutOfMemory.into());
        }
        let body_len = frame.body_len()?;
        self.decoder.body.clear();
        let body = &mut self.decoder.body;
        let read = self.reader.by_ref().take(body_len as u64).read_to_end(body)?;
        if read == body_len { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }

    /// Checks the index at which the reader is, behind its bytes `end`, without keeping it.
    fn check_end(&mut self, mut end: Vec<u8>) -> io::Result<()> {
        // Read to the end of the file
        let mut len = end.len() as u64;
        loop {
            let more = self.reader.fill_buf()?;
            if more.is_empty() {
                break;
            }
            let count = more.len();
            end.extend_from_slice(more);
            end.drain(..end.len().saturating_sub(END_LEN));
            self.reader.consume(count);
            len += count as u64;
        }
        // Compare the lengths
        if !end.ends_with(END_MAGIC) || end.len() < END_LEN {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut numbers = end.as_chunks::<8>().0.iter().map(|bytes| u64::from_be_bytes(*bytes));
        let mut next = || numbers.next().unwrap_or(0);
        let (frame_len, last_len, index_len) = (next(), next(), next());
        if index_len.checked_add(FOOTER) != Some(len) || index_len < 16 {
            return Err(damaged("what follows its frames is neither a frame nor the index"));
        }
        let before = frame_len.checked_mul((index_len - 16) / 8);
        let stated = before.and_then(|before| before.checked_add(last_len));
        if self.content_len > 0 && stated != Some(self.content_len) {
            return Err(damaged("its frames have another length than the index states"));
        }
        Ok(())
    }
}

impl<R: BufRead> Read for ScfReader<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        while self.returned == self.block.len() && !self.is_ended {
            self.next_block()?;
        }
        let rest = self.block.get(self.returned..).unwrap_or_default();
        let len = rest.len().min(to.len());
        to[..len].copy_from_slice(&rest[..len]);
        self.returned += len;
        Ok(len)
    }
}
