//! How readers of text access a file: lines and words from front to back.
//!
//! A small file is in memory as a whole. A large file has a window in memory, which moves forward, so that
//! the memory of reading does not depend on the length of the file. An error of the byte stream ends
//! the text. The owner of the input checks for it ([`TextInput::check_source`]) before any other error.

use std::fmt;
use std::sync::Arc;

mod lines;
mod pieces;

use crate::compression::{ByteStream, StreamError};
use spherule_frame::MemoryBudget;

pub(super) use pieces::LinePiece;
use pieces::PIECE;
pub use pieces::stream_bytes;

/// Text with a window of it in memory.
pub struct TextInput<'a> {
    bytes: TextBytes<'a>,
    /// Offset of what is in memory from the start of the file.
    start: usize,
    /// Where the next byte is in that.
    next: usize,
    /// Offset where the visible text ends.
    end: usize,
    /// Offset to which the input can go back.
    pin: Option<usize>,
    fault: Option<StreamError>,
}

enum TextBytes<'a> {
    Whole(&'a [u8]),
    Stream(Stream<'a>),
}

struct Stream<'a> {
    /// The beginning of the file, enough to detect the format.
    head: Arc<[u8]>,
    source: Box<dyn ByteStream + Send + 'a>,
    window: Vec<u8>,
    /// Whether the source has no more.
    ended: bool,
    /// Bytes of the file, if known for sure.
    len: Option<usize>,
    /// The same, or an estimate.
    len_guess: usize,
    /// Buffers of finished pieces, for reuse.
    spare: Vec<Vec<u8>>,
    /// What the window may take.
    budget: MemoryBudget,
    /// Bytes of a piece.
    piece: usize,
}

impl fmt::Debug for TextInput<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TextInput").field("at", &self.at()).finish_non_exhaustive()
    }
}

impl<'a> TextInput<'a> {
    /// Text that is in memory.
    pub fn whole(bytes: &'a [u8]) -> Self {
        Self::new(TextBytes::Whole(bytes))
    }

    /// The content of `source`, from the start of a file that begins with `head` and has `len` bytes if that is known,
    /// else about `len_guess`. A line or word may be as long as `budget` allows.
    pub fn stream(
        source: Box<dyn ByteStream + Send + 'a>,
        head: Arc<[u8]>,
        (len, len_guess): (Option<usize>, usize),
        budget: MemoryBudget,
    ) -> Self {
        let stream = Stream {
            head,
            source,
            window: Vec::new(),
            ended: false,
            len,
            len_guess,
            spare: Vec::new(),
            budget,
            piece: PIECE,
        };
        Self::new(TextBytes::Stream(stream))
    }

    /// [`Self::stream`] of `bytes`, whose length may be known, in pieces of `piece` bytes: so few that there are many.
    #[cfg(test)]
    pub(in crate::read) fn in_pieces(bytes: &'a [u8], is_known: bool, piece: usize) -> Self {
        let lens = (is_known.then_some(bytes.len()), bytes.len() / 3);
        let source = Box::new(MemoryStream { bytes });
        let mut text = Self::stream(source, bytes.into(), lens, MemoryBudget::UNLIMITED);
        if let TextBytes::Stream(stream) = &mut text.bytes {
            stream.piece = piece;
        }
        text
    }

    const fn new(bytes: TextBytes<'a>) -> Self {
        Self { bytes, start: 0, next: 0, end: usize::MAX, pin: None, fault: None }
    }

    /// Returns the error of the byte stream, once.
    ///
    /// # Errors
    /// That.
    pub fn check_source(&mut self) -> Result<(), StreamError> {
        self.fault.take().map_or(Ok(()), Err)
    }

    /// Reads to the end of the file, so that its checksums are compared.
    pub fn finish(&mut self) {
        self.end = usize::MAX;
        while self.want(1) > 0 {
            self.next += self.rest().len();
        }
    }

    /// Bytes of the file and notes of its stream, if all of it has been read.
    pub fn ended(&self) -> Option<(usize, &[String])> {
        match &self.bytes {
            TextBytes::Whole(_) => None,
            TextBytes::Stream(stream) => stream.source.ended(),
        }
    }

    /// The beginning of the file: all of it if that is in memory.
    pub fn head(&self) -> &[u8] {
        match &self.bytes {
            TextBytes::Whole(bytes) => bytes,
            TextBytes::Stream(stream) => &stream.head,
        }
    }

    /// All of the file if that is in memory.
    pub const fn as_whole(&self) -> Option<&'a [u8]> {
        match self.bytes {
            TextBytes::Whole(bytes) => Some(bytes),
            TextBytes::Stream(_) => None,
        }
    }

    /// Offset of the next byte from the start of the file.
    pub(super) const fn at(&self) -> usize {
        self.start + self.next
    }

    /// The bytes that are left, if that is known.
    pub(in crate::read) fn left(&self) -> Option<usize> {
        let len = match &self.bytes {
            TextBytes::Whole(bytes) => Some(bytes.len()),
            TextBytes::Stream(stream) => stream.len,
        };
        let end = match len {
            Some(len) => len.min(self.end),
            None if self.end < usize::MAX => self.end,
            None => return None,
        };
        Some(end.saturating_sub(self.at()))
    }

    /// The bytes that are left, or an estimate.
    pub(in crate::read) fn left_about(&self) -> usize {
        self.left().unwrap_or_else(|| match &self.bytes {
            TextBytes::Whole(_) => 0,
            TextBytes::Stream(stream) => stream.len_guess.saturating_sub(self.at()),
        })
    }

    /// What is in memory of the rest, up to the end.
    pub(in crate::read) fn rest(&self) -> &[u8] {
        let bytes = match &self.bytes {
            TextBytes::Whole(bytes) => bytes,
            TextBytes::Stream(stream) => stream.window.as_slice(),
        };
        let end = bytes.len().min(self.end.saturating_sub(self.start));
        bytes.get(self.next..end).unwrap_or_default()
    }

    /// Loads until [`Self::rest`] has `count` bytes; returns how many it has, fewer only at the end.
    pub(in crate::read) fn want(&mut self, count: usize) -> usize {
        while self.rest().len() < count && self.load() {}
        self.rest().len()
    }

    /// Puts more bytes into the window; false at the end.
    fn load(&mut self) -> bool {
        let TextBytes::Stream(stream) = &mut self.bytes else {
            return false;
        };
        if stream.ended || self.start + stream.window.len() >= self.end {
            return false;
        }
        let keep = self.pin.map_or(self.next, |pin| pin - self.start);
        stream.window.drain(..keep);
        self.start += keep;
        self.next -= keep;
        let held = stream.window.len();
        if let Err(error) = stream.budget.check(held as u64, "it has a line that is") {
            self.fault = Some(error.into());
            stream.ended = true;
            return false;
        }
        // Long lines are looked through a few times and not each time that some more of them is there.
        let more = stream.piece.max(held);
        stream.window.reserve_exact(more);
        match stream.source.fill(&mut stream.window, more) {
            Ok(count) => {
                stream.ended = count < more;
                count > 0
            }
            Err(error) => {
                self.fault = Some(error);
                stream.ended = true;
                false
            }
        }
    }

    /// True at the end of the visible text.
    pub(in crate::read) fn is_at_end(&mut self) -> bool {
        self.want(1) == 0
    }

    /// Whether the end is that of the file.
    pub(in crate::read) fn is_file_end(&mut self) -> bool {
        let end = std::mem::replace(&mut self.end, usize::MAX);
        let is_end = self.is_at_end();
        self.end = end;
        is_end
    }

    /// Hides everything from byte `end` of the file on.
    pub fn end_at(&mut self, end: usize) {
        self.end = end;
    }

    /// Moves forward to byte `at` of the file, or to its end if that is nearer. Bytes before the window are dropped.
    pub(in crate::read) fn go_to(&mut self, at: usize) {
        if let TextBytes::Whole(bytes) = self.bytes {
            self.next = at.min(bytes.len());
            return;
        }
        while self.at() < at {
            let there = self.rest().len();
            if there >= at - self.at() {
                self.next += at - self.at();
                return;
            }
            self.next += there;
            if self.pin.is_none() && self.pass(at) {
                return;
            }
            if !self.load() {
                return;
            }
        }
    }

    /// Goes on to byte `at` without looking at what is before, if the source can do so.
    fn pass(&mut self, at: usize) -> bool {
        let here = self.at();
        let TextBytes::Stream(stream) = &mut self.bytes else {
            return false;
        };
        if stream.ended || at > self.end || !stream.source.pass(at - here) {
            return false;
        }
        stream.window.clear();
        (self.start, self.next) = (at, 0);
        true
    }

    /// Whether byte `at` can still be reached.
    pub fn can_reach(&self, at: usize) -> bool {
        self.fault.is_none() && at >= self.at()
    }

    /// Steps over `count` bytes of [`Self::rest`].
    pub(in crate::read) fn advance(&mut self, count: usize) {
        self.next += count.min(self.rest().len());
    }

    /// Steps over `count` bytes, or none if there are fewer.
    pub(in crate::read) fn take(&mut self, count: usize) -> bool {
        if self.want(count) < count {
            return false;
        }
        self.next += count;
        true
    }

    /// Runs `peek`, then returns to the current offset.
    pub(in crate::read) fn ahead<T>(&mut self, peek: impl FnOnce(&mut Self) -> T) -> T {
        let at = self.at();
        self.pin = Some(at);
        let result = peek(self);
        self.pin = None;
        self.next = at - self.start;
        result
    }

    /// Whether the window may get more.
    fn can_load(&self) -> bool {
        match &self.bytes {
            TextBytes::Whole(_) => false,
            TextBytes::Stream(stream) => {
                !stream.ended && self.start + stream.window.len() < self.end
            }
        }
    }
}

/// A stream over bytes in memory.
#[cfg(test)]
struct MemoryStream<'a> {
    bytes: &'a [u8],
}

#[cfg(test)]
impl ByteStream for MemoryStream<'_> {
    fn fill(&mut self, to: &mut Vec<u8>, most: usize) -> Result<usize, StreamError> {
        let (some, rest) = self.bytes.split_at(most.min(self.bytes.len()));
        to.extend_from_slice(some);
        self.bytes = rest;
        Ok(some.len())
    }

    fn pass(&mut self, count: usize) -> bool {
        self.bytes = self.bytes.get(count..).unwrap_or_default();
        true
    }

    fn ended(&self) -> Option<(usize, &[String])> {
        None
    }
}
