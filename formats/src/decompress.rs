//! Reads a file from front to back and decompresses it.

use std::io::{self, BufRead, Read, Seek};

use flate2::bufread::GzDecoder;

use crate::budget::MemoryBudget;
use crate::gzip::is_gzip;
use crate::{FrameError, ParseError};

/// Bytes that are decompressed between two checks of the budget.
const STEP: usize = 1 << 20;

/// The reason why the next bytes cannot be read.
#[derive(Debug)]
pub(crate) enum StreamError {
    /// An error of the operating system.
    Io(io::Error),
    /// The bytes are damaged, or there are too many.
    Bytes(ParseError),
}

impl From<ParseError> for StreamError {
    fn from(error: ParseError) -> Self {
        Self::Bytes(error)
    }
}

impl StreamError {
    /// Adds the path of the file.
    pub(crate) fn in_file(self, path: &std::path::Path) -> FrameError {
        match self {
            Self::Io(source) => FrameError::io(path, source),
            Self::Bytes(error) => error.in_file(path),
        }
    }
}

/// Uncompressed bytes in order, read in bounded amounts.
pub(crate) trait ByteStream {
    /// Appends up to `most` bytes to `to`; fewer only at the end of the file.
    ///
    /// # Errors
    /// [`StreamError`].
    fn fill(&mut self, to: &mut Vec<u8>, most: usize) -> Result<usize, StreamError>;

    /// Skips `count` bytes and returns true if that needs no reading; otherwise returns false and does nothing.
    fn pass(&mut self, count: usize) -> bool;

    /// The total number of bytes and the notes, once all bytes have been returned.
    fn ended(&self) -> Option<(usize, &[String])>;
}

/// The content of a file that may be compressed with gzip.
pub(crate) struct Decompressor<R> {
    state: DecompressorState<R>,
    is_compressed: bool,
    /// Number of uncompressed bytes returned so far.
    at: usize,
    notes: Vec<String>,
}

enum DecompressorState<R> {
    Plain(R),
    Packed(GzDecoder<R>),
    Ended,
}

impl<R: BufRead + Seek> Decompressor<R> {
    /// Reads the content of `reader` from its beginning.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(crate) fn new(mut reader: R) -> io::Result<Self> {
        let is_compressed = is_gzip(reader.fill_buf()?);
        let state = if is_compressed {
            DecompressorState::Packed(GzDecoder::new(reader))
        } else {
            DecompressorState::Plain(reader)
        };
        Ok(Self {
            state,
            is_compressed,
            at: 0,
            notes: Vec::new(),
        })
    }

    /// Appends the rest of the content to `bytes`, which holds its beginning, and returns the notes.
    ///
    /// # Errors
    /// [`StreamError`]; [`ParseError::TooLarge`] if the content exceeds `budget`.
    pub(crate) fn finish(
        mut self,
        bytes: &mut Vec<u8>,
        budget: MemoryBudget,
    ) -> Result<Vec<String>, StreamError> {
        loop {
            budget.check(bytes.len() as u64, TOO_LARGE)?;
            // Use the reserved capacity first.
            let step = match bytes.capacity() - bytes.len() {
                0 => STEP,
                room => room.min(STEP),
            };
            if bytes.try_reserve(step).is_err() {
                let there = MemoryBudget::UNLIMITED.less(u64::MAX - bytes.len() as u64);
                return Err(there.exceeded(TOO_LARGE).into());
            }
            if self.fill(bytes, step)? < step {
                budget.check(bytes.len() as u64, TOO_LARGE)?;
                return Ok(self.notes);
            }
        }
    }

    /// Whether the file is gzip.
    pub(crate) const fn is_compressed(&self) -> bool {
        self.is_compressed
    }

    /// The notes so far.
    pub(crate) fn into_notes(self) -> Vec<String> {
        self.notes
    }

    /// The state after a gzip stream: another stream, or the end. Zeros are padding. Anything else is ignored
    /// with a note, as `gzip -d` does.
    fn after_member(&mut self, mut reader: R) -> io::Result<DecompressorState<R>> {
        let next = reader.fill_buf()?;
        if next.first() == Some(&0x1f) && next.get(1).is_none_or(|b| *b == 0x8b) {
            return Ok(DecompressorState::Packed(GzDecoder::new(reader)));
        }
        let (mut count, mut is_padding) = (0, true);
        loop {
            let rest = reader.fill_buf()?;
            if rest.is_empty() {
                break;
            }
            is_padding &= rest.iter().all(|b| *b == 0);
            let len = rest.len();
            count += len;
            reader.consume(len);
        }
        if !is_padding {
            self.notes
                .push(format!("{count} bytes after the gzip stream are ignored"));
        }
        Ok(DecompressorState::Ended)
    }
}

/// Beginning of the message for content that is too large.
const TOO_LARGE: &str = "decompressed it is";

impl<R: BufRead + Seek> ByteStream for Decompressor<R> {
    fn pass(&mut self, count: usize) -> bool {
        let DecompressorState::Plain(reader) = &mut self.state else {
            return false;
        };
        let passed = i64::try_from(count).is_ok_and(|count| reader.seek_relative(count).is_ok());
        if passed {
            self.at += count;
        }
        passed
    }

    fn ended(&self) -> Option<(usize, &[String])> {
        matches!(self.state, DecompressorState::Ended).then_some((self.at, &self.notes))
    }

    fn fill(&mut self, to: &mut Vec<u8>, most: usize) -> Result<usize, StreamError> {
        let start = to.len();
        while to.len() - start < most {
            let left = (most - (to.len() - start)) as u64;
            let before = to.len();
            // Read from the current stream; at its end, prepare the next one
            match std::mem::replace(&mut self.state, DecompressorState::Ended) {
                DecompressorState::Plain(mut reader) => {
                    let read = reader.by_ref().take(left).read_to_end(to);
                    if read.map_err(StreamError::Io)? as u64 == left {
                        self.state = DecompressorState::Plain(reader);
                    }
                }
                DecompressorState::Packed(mut decoder) => {
                    let read = decoder.by_ref().take(left).read_to_end(to);
                    let at = self.at + (to.len() - before);
                    let read = read.map_err(|e| damaged(at, e))?;
                    self.state = if read as u64 == left {
                        DecompressorState::Packed(decoder)
                    } else {
                        let reader = decoder.into_inner();
                        self.after_member(reader).map_err(StreamError::Io)?
                    };
                }
                DecompressorState::Ended => break,
            }
            self.at += to.len() - before;
        }
        Ok(to.len() - start)
    }
}

/// The error for a gzip stream that is damaged after `at` good bytes.
fn damaged(at: usize, error: io::Error) -> StreamError {
    if error.raw_os_error().is_some() {
        return StreamError::Io(error);
    }
    let what = match error.kind() {
        io::ErrorKind::UnexpectedEof => {
            "the gzip stream ends early here; perhaps it is still being written".to_owned()
        }
        io::ErrorKind::OutOfMemory => "no memory left to unpack the gzip stream".to_owned(),
        _ => format!("the gzip stream is damaged: {error}"),
    };
    StreamError::Bytes(ParseError::malformed(at, what))
}
