//! Reads a file from front to back and decompresses it.

use std::io::{self, BufRead, Read, Seek, SeekFrom};

use super::member::{StreamDecoder, is_early_end};
use super::{Compression, SKIPPABLE_HEADER, StreamFormat, skippable_len};
use spherule_frame::{FrameError, MemoryBudget, ParseError};

/// Bytes that are decompressed between two checks of the budget.
const STEP: usize = 1 << 20;

/// The reason why the next bytes cannot be read.
#[derive(Debug)]
pub enum StreamError {
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
    pub fn in_file(self, path: &std::path::Path) -> FrameError {
        match self {
            Self::Io(source) => FrameError::io(path, source),
            Self::Bytes(error) => error.in_file(path),
        }
    }
}

/// Uncompressed bytes in order, read in bounded amounts.
pub trait ByteStream {
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

/// The content of a file that may be compressed.
pub struct Decompressor<R: BufRead> {
    state: DecompressorState<R>,
    /// `None` for a file that is not compressed.
    compression: Option<Compression>,
    /// Bytes that decoders held at most beside their output.
    decoder_len: u64,
    budget: MemoryBudget,
    /// Number of uncompressed bytes returned so far.
    at: usize,
    /// Bytes of the file, if it is compressed.
    stored_len: u64,
    notes: Vec<String>,
}

enum DecompressorState<R: BufRead> {
    Plain(R),
    Packed(StreamDecoder<R>),
    Ended,
}

impl<R: BufRead + Seek> Decompressor<R> {
    /// Reads the content of `reader` from its beginning. Decoders hold no more than `budget` beside their output.
    ///
    /// # Errors
    /// [`StreamError`] if the file cannot be read, or is an archive of several files, or the first decoder cannot
    /// begin.
    pub fn new(mut reader: R, budget: MemoryBudget) -> Result<Self, StreamError> {
        let compression = Compression::detect(&mut reader)?;
        let stored_len = match &compression {
            Some(_) => len_of(&mut reader).map_err(StreamError::Io)?,
            None => 0,
        };
        let mut this = Self {
            state: DecompressorState::Ended,
            compression: compression.clone(),
            decoder_len: 0,
            budget,
            at: 0,
            stored_len,
            notes: Vec::new(),
        };
        this.state = match compression {
            None => DecompressorState::Plain(reader),
            Some(Compression::Zip(file)) => {
                let decoder = StreamDecoder::zip(reader, file);
                DecompressorState::Packed(decoder.map_err(StreamError::Io)?)
            }
            Some(Compression::Streams(format)) => this.next_stream(format, reader)?,
        };
        Ok(this)
    }

    /// Appends the rest of the content to `bytes`, which holds its beginning, and returns the notes.
    ///
    /// # Errors
    /// [`StreamError`]; [`ParseError::TooLarge`] if the content exceeds `budget`.
    pub fn finish(
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

    /// Whether the file is compressed.
    pub const fn is_compressed(&self) -> bool {
        self.compression.is_some()
    }

    /// Bytes that the decoder holds beside its output.
    pub const fn decoder_len(&self) -> u64 {
        self.decoder_len
    }

    /// The length of the content if the header of the stream states it.
    pub(super) fn stated_len(&self) -> Option<u64> {
        match &self.state {
            DecompressorState::Packed(decoder) => decoder.stated_len(),
            DecompressorState::Plain(_) | DecompressorState::Ended => None,
        }
    }

    /// Bytes that have been decoded and not yet returned, as far as that is known: the window of zstd.
    pub(super) fn held_back_len(&self) -> u64 {
        match &self.state {
            DecompressorState::Packed(StreamDecoder::Zstd(_)) => self.decoder_len,
            _ => 0,
        }
    }

    /// The notes so far.
    pub fn into_notes(self) -> Vec<String> {
        self.notes
    }

    /// Begins the stream at which `reader` is, behind frames that are to be skipped.
    fn next_stream(
        &mut self,
        format: StreamFormat,
        mut reader: R,
    ) -> Result<DecompressorState<R>, StreamError> {
        if format.has_skippable_frames() {
            skip_frames(&mut reader).map_err(StreamError::Io)?;
            if reader.fill_buf().map_err(StreamError::Io)?.is_empty() {
                return Ok(DecompressorState::Ended);
            }
        }
        let decoder = StreamDecoder::new(format, reader, self.budget);
        let (decoder, decoder_len) = decoder.map_err(|e| self.damaged(self.at, e))?;
        self.decoder_len = self.decoder_len.max(decoder_len);
        Ok(DecompressorState::Packed(decoder))
    }

    /// The state after `decoder`, which has been read to its end.
    fn after_decoder(
        &mut self,
        decoder: StreamDecoder<R>,
    ) -> Result<DecompressorState<R>, StreamError> {
        decoder.check_end().map_err(|e| self.damaged(self.at, e))?;
        match (&self.compression, decoder.into_inner()) {
            (Some(Compression::Streams(format)), Some(reader)) => {
                self.after_stream(*format, reader)
            }
            _ => Ok(DecompressorState::Ended),
        }
    }

    /// The state after a stream: another stream, or the end. Zeros are padding. Anything else is ignored with a note,
    /// as `gzip -d` does.
    fn after_stream(
        &mut self,
        format: StreamFormat,
        mut reader: R,
    ) -> Result<DecompressorState<R>, StreamError> {
        let next = reader.fill_buf().map_err(StreamError::Io)?;
        if format.may_begin(next) || format.has_skippable_frames() && skippable_len(next).is_some()
        {
            return self.next_stream(format, reader);
        }
        let (mut count, mut is_padding) = (0, true);
        loop {
            let rest = reader.fill_buf().map_err(StreamError::Io)?;
            if rest.is_empty() {
                break;
            }
            let zeros = rest.iter().take_while(|byte| **byte == 0).count();
            // Streams of xz may have padding between them
            let is_behind_padding = is_padding && count > 0 && zeros == 0;
            if format == StreamFormat::Xz && is_behind_padding && format.may_begin(rest) {
                return self.next_stream(format, reader);
            }
            is_padding &= zeros > 0;
            let len = if is_padding { zeros } else { rest.len() };
            count += len;
            reader.consume(len);
        }
        if !is_padding {
            let name = format.name();
            self.notes.push(format!("{count} bytes after the {name} stream are ignored"));
        }
        Ok(DecompressorState::Ended)
    }

    /// The error for a stream that is damaged after `at` good bytes.
    fn damaged(&self, at: usize, error: io::Error) -> StreamError {
        if error.raw_os_error().is_some() {
            return StreamError::Io(error);
        }
        let name = self.compression.as_ref().map_or("", Compression::name);
        if error.kind() == io::ErrorKind::OutOfMemory {
            let what = format!(
                "its {name} stream needs more memory to be decompressed than is allowed; compress it with a smaller \
                 window or dictionary, or allow more"
            );
            return ParseError::too_large(what).into();
        }
        if error.kind() == io::ErrorKind::Unsupported {
            return ParseError::unsupported(error.to_string()).into();
        }
        // Frames of Blosc may end early in the middle of the file
        let is_at_end = !matches!(self.compression, Some(Compression::Zip(_))) && name != "blosc";
        let place = if is_at_end {
            format!(", at byte {} of the file", self.stored_len)
        } else {
            String::new()
        };
        let what = if is_early_end(&error) {
            format!("the {name} stream ends early here{place}; perhaps it is still being written")
        } else {
            format!("the {name} stream is damaged: {error}")
        };
        ParseError::malformed(at, what).into()
    }
}

/// Bytes of the file that `reader` reads, whose place stays the same.
fn len_of(reader: &mut impl Seek) -> io::Result<u64> {
    let here = reader.stream_position()?;
    let len = reader.seek(SeekFrom::End(0))?;
    reader.seek(SeekFrom::Start(here))?;
    Ok(len)
}

/// Skips the frames at which `reader` is that are not part of the content.
fn skip_frames(reader: &mut impl BufRead) -> io::Result<()> {
    while let Some(len) = skippable_len(reader.fill_buf()?) {
        let len = u64::from(len) + SKIPPABLE_HEADER as u64;
        io::copy(&mut reader.by_ref().take(len), &mut io::sink())?;
    }
    Ok(())
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
                    let read = read.map_err(|e| self.damaged(at, e))?;
                    self.state = if read as u64 == left {
                        DecompressorState::Packed(decoder)
                    } else {
                        self.at = at;
                        let state = self.after_decoder(decoder);
                        self.at = at - (to.len() - before);
                        state?
                    };
                }
                DecompressorState::Ended => break,
            }
            self.at += to.len() - before;
        }
        Ok(to.len() - start)
    }
}
