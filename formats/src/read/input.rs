//! The one way by which readers of text see a file: its lines and words in their order.
//!
//! A small file lies in memory as a whole. Of a large one no more than a window is there, which moves on, so that
//! what reading takes does not depend on the length of the file. What goes wrong with the source of its bytes ends
//! the text, and whoever made the input asks for it ([`TextInput::check_source`]) before it believes anything else.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use memchr::{memchr, memchr_iter, memchr2, memrchr};

use super::table::pieces_at_once;
use super::text::Line;
use crate::MemoryBudget;
use crate::decompress::{ByteStream, StreamError};

/// Bytes of a piece of text in memory: large enough to hide the cost of a task.
const WHOLE_PIECE: usize = 1 << 20;

/// Bytes of a piece of a stream: smaller, since all pieces at work are held.
const PIECE: usize = 1 << 18;

/// Bytes that are held while a stream is read: the window, which has the end of what was there before a load; and of
/// rows the pieces at work, and what is found in them, as much.
pub(crate) fn stream_bytes(is_rows: bool) -> u64 {
    let pieces = if is_rows { pieces_at_once() } else { 0 };
    (2 * PIECE * (pieces + 1)) as u64
}

/// Text of which some is in memory.
pub(crate) struct TextInput<'a> {
    bytes: Bytes<'a>,
    /// Offset of what is in memory from the start of the file.
    start: usize,
    /// Where the next byte is in that.
    next: usize,
    /// Offset behind which nothing is seen.
    end: usize,
    /// Offset that can be gone back to.
    pin: Option<usize>,
    fault: Option<StreamError>,
}

enum Bytes<'a> {
    Whole(&'a [u8]),
    Stream(Stream<'a>),
}

struct Stream<'a> {
    /// The beginning of the file, enough to tell what it is.
    head: Arc<[u8]>,
    source: Box<dyn ByteStream + Send + 'a>,
    window: Vec<u8>,
    /// Whether the source has no more.
    ended: bool,
    /// Bytes of the file, if known for sure.
    len: Option<usize>,
    /// The same, or a guess.
    len_guess: usize,
    /// Memory of pieces that are done.
    spare: Vec<Vec<u8>>,
    /// What the window may take.
    budget: MemoryBudget,
    /// Bytes of a piece.
    piece: usize,
}

impl fmt::Debug for TextInput<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TextInput")
            .field("at", &self.at())
            .finish_non_exhaustive()
    }
}

/// Whole lines.
pub(super) struct LinePiece<'a> {
    /// Offset of the first byte from the start of the file.
    pub(super) at: usize,
    /// The lines, with their ends.
    pub(super) bytes: Cow<'a, [u8]>,
    /// How many they are.
    pub(super) lines: usize,
    /// Whether the file ends with it.
    pub(super) ends_file: bool,
}

impl<'a> TextInput<'a> {
    /// Text that is in memory.
    pub(crate) fn whole(bytes: &'a [u8]) -> Self {
        Self::new(Bytes::Whole(bytes))
    }

    /// What `source` gives from the start of a file on, which begins with `head` and has `len` bytes if that is known,
    /// else about `len_guess`. A line or word may be as long as `budget` allows.
    pub(crate) fn stream(
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
        Self::new(Bytes::Stream(stream))
    }

    /// [`Self::stream`] of `bytes`, whose length may be known, in pieces of `piece` bytes: so few that there are many.
    #[cfg(test)]
    pub(super) fn in_pieces(bytes: &'a [u8], is_known: bool, piece: usize) -> Self {
        let lens = (is_known.then_some(bytes.len()), bytes.len() / 3);
        let source = Box::new(Drip { bytes });
        let mut text = Self::stream(source, bytes.into(), lens, MemoryBudget::UNLIMITED);
        if let Bytes::Stream(stream) = &mut text.bytes {
            stream.piece = piece;
        }
        text
    }

    const fn new(bytes: Bytes<'a>) -> Self {
        Self {
            bytes,
            start: 0,
            next: 0,
            end: usize::MAX,
            pin: None,
            fault: None,
        }
    }

    /// What went wrong with the source, once.
    ///
    /// # Errors
    /// That.
    pub(crate) fn check_source(&mut self) -> Result<(), StreamError> {
        self.fault.take().map_or(Ok(()), Err)
    }

    /// Goes to the end of the file, looking at all of it, so that its checksums are.
    pub(crate) fn finish(&mut self) {
        self.end = usize::MAX;
        while self.want(1) > 0 {
            self.next += self.rest().len();
        }
    }

    /// Bytes of the file and oddities of its source, if all of it has been read.
    pub(crate) fn ended(&self) -> Option<(usize, &[String])> {
        match &self.bytes {
            Bytes::Whole(_) => None,
            Bytes::Stream(stream) => stream.source.ended(),
        }
    }

    /// The beginning of the file: all of it if that is in memory.
    pub(crate) fn head(&self) -> &[u8] {
        match &self.bytes {
            Bytes::Whole(bytes) => bytes,
            Bytes::Stream(stream) => &stream.head,
        }
    }

    /// All of the file if that is in memory.
    pub(crate) const fn as_whole(&self) -> Option<&'a [u8]> {
        match self.bytes {
            Bytes::Whole(bytes) => Some(bytes),
            Bytes::Stream(_) => None,
        }
    }

    /// Offset of the next byte from the start of the file.
    pub(super) const fn at(&self) -> usize {
        self.start + self.next
    }

    /// The bytes that are left, if that is known.
    pub(super) fn left(&self) -> Option<usize> {
        let len = match &self.bytes {
            Bytes::Whole(bytes) => Some(bytes.len()),
            Bytes::Stream(stream) => stream.len,
        };
        let end = match len {
            Some(len) => len.min(self.end),
            None if self.end < usize::MAX => self.end,
            None => return None,
        };
        Some(end.saturating_sub(self.at()))
    }

    /// The bytes that are left, or a guess of them.
    pub(super) fn left_about(&self) -> usize {
        self.left().unwrap_or_else(|| match &self.bytes {
            Bytes::Whole(_) => 0,
            Bytes::Stream(stream) => stream.len_guess.saturating_sub(self.at()),
        })
    }

    /// What is in memory of the rest, up to the end.
    pub(super) fn rest(&self) -> &[u8] {
        let bytes = match &self.bytes {
            Bytes::Whole(bytes) => bytes,
            Bytes::Stream(stream) => stream.window.as_slice(),
        };
        let end = bytes.len().min(self.end.saturating_sub(self.start));
        bytes.get(self.next..end).unwrap_or_default()
    }

    /// Sees to it that [`Self::rest`] has `count` bytes; returns how many it has, fewer only at the end.
    pub(super) fn want(&mut self, count: usize) -> usize {
        while self.rest().len() < count && self.load() {}
        self.rest().len()
    }

    /// Puts more bytes into the window; false at the end.
    fn load(&mut self) -> bool {
        let Bytes::Stream(stream) = &mut self.bytes else {
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

    /// True if nothing is left before the end.
    pub(super) fn is_at_end(&mut self) -> bool {
        self.want(1) == 0
    }

    /// Whether the end is that of the file.
    pub(super) fn is_file_end(&mut self) -> bool {
        let end = std::mem::replace(&mut self.end, usize::MAX);
        let is_end = self.is_at_end();
        self.end = end;
        is_end
    }

    /// Sees nothing from byte `end` of the file on.
    pub(crate) fn end_at(&mut self, end: usize) {
        self.end = end;
    }

    /// Goes on to byte `at` of the file, or to its end if that is nearer. What lies before the window is gone.
    pub(super) fn go_to(&mut self, at: usize) {
        if let Bytes::Whole(bytes) = self.bytes {
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
        let Bytes::Stream(stream) = &mut self.bytes else {
            return false;
        };
        if stream.ended || at > self.end || !stream.source.pass(at - here) {
            return false;
        }
        stream.window.clear();
        (self.start, self.next) = (at, 0);
        true
    }

    /// Whether byte `at` can still be gone to.
    pub(crate) fn can_reach(&self, at: usize) -> bool {
        self.fault.is_none() && at >= self.at()
    }

    /// Steps over `count` bytes of [`Self::rest`].
    pub(super) fn advance(&mut self, count: usize) {
        self.next += count.min(self.rest().len());
    }

    /// Steps over `count` bytes, or none if there are fewer.
    pub(super) fn take(&mut self, count: usize) -> bool {
        if self.want(count) < count {
            return false;
        }
        self.next += count;
        true
    }

    /// Does `look`, and goes back to where it began.
    pub(super) fn ahead<T>(&mut self, look: impl FnOnce(&mut Self) -> T) -> T {
        let at = self.at();
        self.pin = Some(at);
        let seen = look(self);
        self.pin = None;
        self.next = at - self.start;
        seen
    }

    /// How far off the next `byte` is; if there is none, all that is left is in memory.
    fn find(&mut self, byte: u8) -> Option<usize> {
        let mut looked_at = 0;
        loop {
            let rest = self.rest();
            if let Some(found) = memchr(byte, rest.get(looked_at..).unwrap_or_default()) {
                return Some(looked_at + found);
            }
            looked_at = rest.len();
            if self.want(looked_at + 1) == looked_at {
                return None;
            }
        }
    }

    /// The next line, which stays next.
    pub(super) fn peek_line(&mut self) -> Option<Line<'_>> {
        if self.is_at_end() {
            return None;
        }
        let newline = self.find(b'\n');
        let at = self.at();
        let rest = self.rest();
        let text = newline.map_or(rest, |newline| &rest[..newline]);
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        Some(Line { at, text })
    }

    /// The next line.
    pub(super) fn line(&mut self) -> Option<Line<'_>> {
        if self.is_at_end() {
            return None;
        }
        let newline = self.find(b'\n');
        let (start, at) = (self.next, self.at());
        let len = newline.unwrap_or(self.rest().len());
        self.next += len + usize::from(newline.is_some());
        let bytes = match &self.bytes {
            Bytes::Whole(bytes) => bytes,
            Bytes::Stream(stream) => stream.window.as_slice(),
        };
        let text = &bytes[start..start + len];
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        Some(Line { at, text })
    }

    /// How long the next line is without its end, which is a line feed or a carriage return; none at the end.
    pub(super) fn line_len(&mut self) -> Option<usize> {
        if self.is_at_end() {
            return None;
        }
        let mut looked_at = 0;
        loop {
            let rest = self.rest();
            let new = rest.get(looked_at..).unwrap_or_default();
            if let Some(end) = memchr2(b'\n', b'\r', new) {
                return Some(looked_at + end);
            }
            looked_at = rest.len();
            if self.want(looked_at + 1) == looked_at {
                return Some(looked_at);
            }
        }
    }

    /// The next `len` bytes of [`Self::rest`]; goes on behind the byte after them.
    pub(super) fn take_line(&mut self, len: usize) -> &[u8] {
        let start = self.next;
        self.advance(len + 1);
        let bytes = match &self.bytes {
            Bytes::Whole(bytes) => bytes,
            Bytes::Stream(stream) => stream.window.as_slice(),
        };
        bytes.get(start..start + len).unwrap_or_default()
    }

    /// Whether a newline is before what comes next, so that the line before is whole.
    pub(super) fn is_behind_newline(&self) -> bool {
        let bytes = match &self.bytes {
            Bytes::Whole(bytes) => bytes,
            Bytes::Stream(stream) => stream.window.as_slice(),
        };
        self.next > 0 && bytes.get(self.next - 1) == Some(&b'\n')
    }

    /// Passes over `count` lines without looking into them; returns how many there were. A last line without a
    /// newline counts.
    pub(super) fn pass_lines(&mut self, count: usize) -> usize {
        let mut passed = 0;
        let mut is_open = false;
        while passed < count && !self.is_at_end() {
            let rest = self.rest();
            match memchr_iter(b'\n', rest).nth(count - passed - 1) {
                Some(newline) => {
                    self.next += newline + 1;
                    return count;
                }
                None => {
                    passed += memchr_iter(b'\n', rest).count();
                    is_open = rest.last() != Some(&b'\n');
                    self.next += rest.len();
                }
            }
        }
        (passed + usize::from(is_open)).min(count)
    }

    /// Passes over blank lines, `most` of them; returns how many there were.
    pub(super) fn pass_blank_lines(&mut self, most: usize) -> usize {
        let mut passed = 0;
        while passed < most && self.peek_line().is_some_and(|line| line.is_blank()) {
            self.line();
            passed += 1;
        }
        passed
    }

    /// Passes over white space.
    pub(super) fn pass_blanks(&mut self) {
        while !self.is_at_end() {
            let rest = self.rest();
            let blanks = rest.len() - rest.trim_ascii_start().len();
            self.next += blanks;
            if blanks == 0 {
                return;
            }
        }
    }

    /// Bytes of the rest that end with a whole word: about as many as `count` words have, nothing at the end alone.
    pub(super) fn words(&mut self, count: usize) -> &[u8] {
        let mut near = count.saturating_mul(16).clamp(4096, PIECE);
        loop {
            let there = self.want(near);
            if !self.can_load() {
                return self.rest();
            }
            let near_words = &self.rest()[..near.min(there)];
            if let Some(last) = near_words.iter().rposition(u8::is_ascii_whitespace) {
                return &self.rest()[..=last];
            }
            near = near.saturating_mul(2);
        }
    }

    /// Pieces of about as many bytes as are worth a task, together no more than `lines` lines; none at the end.
    pub(super) fn pieces(&mut self, mut lines: usize) -> Vec<LinePiece<'a>> {
        let mut pieces = Vec::with_capacity(pieces_at_once());
        while pieces.len() < pieces_at_once()
            && lines > 0
            && let Some(piece) = self.piece(lines)
        {
            lines -= piece.lines;
            pieces.push(piece);
        }
        pieces
    }

    /// A piece of up to `lines` lines.
    fn piece(&mut self, lines: usize) -> Option<LinePiece<'a>> {
        let wanted = match &self.bytes {
            Bytes::Whole(_) => WHOLE_PIECE,
            Bytes::Stream(stream) => stream.piece,
        };
        let there = self.want(wanted);
        if there == 0 {
            return None;
        }
        let near = &self.rest()[..there.min(wanted)];
        let mut cut = if there <= wanted && !self.can_load() {
            there
        } else if let Some(newline) = memrchr(b'\n', near) {
            newline + 1
        } else {
            let newline = self.find(b'\n');
            newline.map_or(self.rest().len(), |newline| newline + 1)
        };
        // What ends without a newline is a line, too.
        let count = |bytes: &[u8]| {
            let is_open = bytes.last() != Some(&b'\n');
            memchr_iter(b'\n', bytes).count() + usize::from(is_open)
        };
        let mut found = count(&self.rest()[..cut]);
        if found > lines {
            let last = memchr_iter(b'\n', self.rest()).nth(lines - 1);
            cut = last.map_or(cut, |newline| newline + 1);
            found = lines;
        }
        let at = self.at();
        let (from, to) = (self.next, self.next + cut);
        self.next = to;
        let bytes = match &mut self.bytes {
            Bytes::Whole(bytes) => Cow::Borrowed(&bytes[from..to]),
            Bytes::Stream(stream) => {
                let mut piece = stream.spare.pop().unwrap_or_default();
                piece.clear();
                piece.extend_from_slice(&stream.window[from..to]);
                Cow::Owned(piece)
            }
        };
        let is_open = bytes.last() != Some(&b'\n');
        Some(LinePiece {
            at,
            bytes,
            lines: found,
            ends_file: is_open && self.is_file_end(),
        })
    }

    /// Whether the window may get more.
    fn can_load(&self) -> bool {
        match &self.bytes {
            Bytes::Whole(_) => false,
            Bytes::Stream(stream) => !stream.ended && self.start + stream.window.len() < self.end,
        }
    }

    /// Uses the memory of `pieces` for those to come.
    pub(super) fn take_back(&mut self, pieces: Vec<LinePiece<'a>>) {
        if let Bytes::Stream(stream) = &mut self.bytes {
            let owned = pieces.into_iter().map(|piece| piece.bytes.into_owned());
            stream.spare.extend(owned);
        }
    }
}

/// Bytes that come from memory.
#[cfg(test)]
struct Drip<'a> {
    bytes: &'a [u8],
}

#[cfg(test)]
impl ByteStream for Drip<'_> {
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
