//! Lines and words of a [`TextInput`].

use memchr::{memchr, memchr_iter, memchr2};

use super::pieces::PIECE;
use super::{TextBytes, TextInput};
use crate::read::text::Line;

impl TextInput<'_> {
    /// Distance to the next `byte`. If there is none, all of the rest is in memory.
    pub(super) fn find(&mut self, byte: u8) -> Option<usize> {
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

    /// The next line, without consuming it.
    pub(in crate::read) fn peek_line(&mut self) -> Option<Line<'_>> {
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
    pub(in crate::read) fn line(&mut self) -> Option<Line<'_>> {
        if self.is_at_end() {
            return None;
        }
        let newline = self.find(b'\n');
        let (start, at) = (self.next, self.at());
        let len = newline.unwrap_or(self.rest().len());
        self.next += len + usize::from(newline.is_some());
        let bytes = match &self.bytes {
            TextBytes::Whole(bytes) => bytes,
            TextBytes::Stream(stream) => stream.window.as_slice(),
        };
        let text = &bytes[start..start + len];
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        Some(Line { at, text })
    }

    /// How long the next line is without its end, which is a line feed or a carriage return; none at the end.
    pub(in crate::read) fn line_len(&mut self) -> Option<usize> {
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

    /// The next `len` bytes of [`Self::rest`]; continues after the byte that follows them.
    pub(in crate::read) fn take_line(&mut self, len: usize) -> &[u8] {
        let start = self.next;
        self.advance(len + 1);
        let bytes = match &self.bytes {
            TextBytes::Whole(bytes) => bytes,
            TextBytes::Stream(stream) => stream.window.as_slice(),
        };
        bytes.get(start..start + len).unwrap_or_default()
    }

    /// Whether the last consumed byte is a newline, so that the last line is complete.
    pub(in crate::read) fn is_behind_newline(&self) -> bool {
        let bytes = match &self.bytes {
            TextBytes::Whole(bytes) => bytes,
            TextBytes::Stream(stream) => stream.window.as_slice(),
        };
        self.next > 0 && bytes.get(self.next - 1) == Some(&b'\n')
    }

    /// Skips `count` lines without parsing them; returns how many there were. A last line without a
    /// newline counts.
    pub(in crate::read) fn pass_lines(&mut self, count: usize) -> usize {
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

    /// Skips up to `most` blank lines; returns how many there were.
    pub(in crate::read) fn pass_blank_lines(&mut self, most: usize) -> usize {
        let mut passed = 0;
        while passed < most && self.peek_line().is_some_and(|line| line.is_blank()) {
            self.line();
            passed += 1;
        }
        passed
    }

    /// Skips white space.
    pub(in crate::read) fn pass_blanks(&mut self) {
        while !self.is_at_end() {
            let rest = self.rest();
            let blanks = rest.len() - rest.trim_ascii_start().len();
            self.next += blanks;
            if blanks == 0 {
                return;
            }
        }
    }

    /// Bytes of the rest that end with a whole word: about as many as `count` words have; empty only at the end.
    pub(in crate::read) fn words(&mut self, count: usize) -> &[u8] {
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
}
