//! A cursor in a file that mixes text lines with binary payloads: takes lines and byte counts, never
//! searches inside a payload.

use crate::read::input::TextInput;
use spherule_frame::ParseError;

/// A keyword line of a sane file is shorter; a longer one means that we peek at binary data.
const LONGEST_LINE: usize = 1 << 16;

/// Reading position in the file.
pub(super) struct LineCursor<'c, 'a> {
    text: &'c mut TextInput<'a>,
}

/// One text line without its end, and where it started.
#[derive(Debug, Clone)]
pub(super) struct VtkLine {
    pub(super) at: usize,
    pub(super) text: Vec<u8>,
}

impl<'c, 'a> LineCursor<'c, 'a> {
    pub(super) const fn new(text: &'c mut TextInput<'a>) -> Self {
        Self { text }
    }

    pub(super) const fn at(&self) -> usize {
        self.text.at()
    }

    /// Where numbers written as text are read from.
    pub(super) const fn text(&mut self) -> &mut TextInput<'a> {
        self.text
    }

    /// The whole file, if it is in memory, as all binary ones are.
    pub(super) fn bytes(&self) -> &'a [u8] {
        self.text.as_whole().unwrap_or_default()
    }

    /// What is left of the file, as far as it is in memory.
    pub(super) fn rest(&self) -> &[u8] {
        self.text.rest()
    }

    /// Passes over the next `count` bytes, or over none if the file is shorter.
    pub(super) fn take(&mut self, count: usize) -> Option<()> {
        self.text.take(count).then_some(())
    }

    /// Runs `peek`, then returns to the current offset.
    pub(super) fn ahead<T>(&mut self, peek: impl FnOnce(&mut LineCursor<'_, 'a>) -> T) -> T {
        self.text.ahead(|text| peek(&mut LineCursor { text }))
    }

    /// Goes on to byte `at`.
    pub(super) fn go_to(&mut self, at: usize) {
        self.text.go_to(at);
    }

    /// Whether `keyword` follows, after white space.
    pub(super) fn goes_on_with(&mut self, keyword: &[u8]) -> bool {
        self.ahead(|cursor| {
            cursor.text.pass_blanks();
            cursor.text.want(keyword.len() + 1);
            let ahead = cursor.rest().split_at_checked(keyword.len());
            ahead.is_some_and(|(word, rest)| {
                word.eq_ignore_ascii_case(keyword)
                    && rest.first().is_none_or(u8::is_ascii_whitespace)
            })
        })
    }

    /// The next line, blank or not; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Result<Option<VtkLine>, ParseError> {
        let there = self.text.want(LONGEST_LINE + 1);
        if there == 0 {
            return Ok(None);
        }
        let (at, rest) = (self.at(), self.rest());
        let near = rest.get(..LONGEST_LINE).unwrap_or(rest);
        let (text, used) = match memchr::memchr(b'\n', near) {
            Some(end) => (near.get(..end).unwrap_or_default(), end + 1),
            None if near.len() == there => (near, near.len()),
            None => {
                return Err(ParseError::malformed(
                    at,
                    format!(
                        "no line end within {LONGEST_LINE} bytes where a text line should be; an \
                         earlier count may be wrong"
                    ),
                ));
            }
        };
        let text = text.to_vec();
        self.text.advance(used);
        Ok(Some(VtkLine { at, text }))
    }

    /// The next line that is not blank.
    pub(super) fn keyword_line(&mut self) -> Result<Option<VtkLine>, ParseError> {
        self.text.pass_blanks();
        self.line()
    }
}

impl VtkLine {
    /// The words of the line.
    pub(super) fn words(&self) -> Vec<&[u8]> {
        self.text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect()
    }

    /// True if the first word is `keyword`, in whatever case.
    pub(super) fn starts_with(&self, keyword: &str) -> bool {
        self.first_word().eq_ignore_ascii_case(keyword.as_bytes())
    }

    pub(super) fn first_word(&self) -> &[u8] {
        self.text.trim_ascii_start().split(u8::is_ascii_whitespace).next().unwrap_or_default()
    }

    /// The beginning of the line, fit for an error message.
    pub(super) fn shown(&self) -> String {
        shown(&self.text)
    }
}

/// The first 40 bytes of `text` with control and foreign bytes escaped.
pub(super) fn shown(text: &[u8]) -> String {
    let head = text.trim_ascii();
    head.get(..40).unwrap_or(head).escape_ascii().to_string()
}
