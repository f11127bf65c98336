//! A place in a file that mixes text lines with binary payloads: takes lines and byte counts, never
//! searches inside a payload.

use crate::ParseError;

/// A keyword line of a sane file is shorter; a longer one means that we look at binary data.
const LONGEST_LINE: usize = 1 << 16;

/// Reading position in the file.
#[derive(Debug, Clone)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// One text line without its end, and where it started.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    pub(super) at: usize,
    pub(super) text: &'a [u8],
}

impl<'a> Cursor<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(super) const fn at(&self) -> usize {
        self.at
    }

    /// The whole file.
    pub(super) const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// What is left of the file.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Moves to byte `at`, or to the end of the file if that is nearer.
    pub(super) fn go_to(&mut self, at: usize) {
        self.at = at.min(self.bytes.len());
    }

    /// The next `count` bytes, or `None` (and no move) if the file is shorter.
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.rest().get(..count)?;
        self.at += count;
        Some(taken)
    }

    pub(super) fn skip_whitespace(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_ascii_start().len();
    }

    /// The next line, blank or not; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Result<Option<Line<'a>>, ParseError> {
        let rest = self.rest();
        if rest.is_empty() {
            return Ok(None);
        }
        let near = rest.get(..LONGEST_LINE).unwrap_or(rest);
        let (text, used) = match memchr::memchr(b'\n', near) {
            Some(end) => (near.get(..end).unwrap_or_default(), end + 1),
            None if near.len() == rest.len() => (near, near.len()),
            None => {
                return Err(ParseError::malformed(
                    self.at,
                    format!(
                        "no line end within {LONGEST_LINE} bytes where a text line should be; an \
                         earlier count may be wrong"
                    ),
                ));
            }
        };
        let line = Line { at: self.at, text };
        self.at += used;
        Ok(Some(line))
    }

    /// The next line that is not blank.
    pub(super) fn keyword_line(&mut self) -> Result<Option<Line<'a>>, ParseError> {
        self.skip_whitespace();
        self.line()
    }
}

impl<'a> Line<'a> {
    /// The words of the line.
    pub(super) fn words(&self) -> Vec<&'a [u8]> {
        self.text
            .split(u8::is_ascii_whitespace)
            .filter(|w| !w.is_empty())
            .collect()
    }

    /// True if the first word is `keyword`, in whatever case.
    pub(super) fn starts_with(&self, keyword: &str) -> bool {
        self.first_word().eq_ignore_ascii_case(keyword.as_bytes())
    }

    pub(super) fn first_word(&self) -> &'a [u8] {
        self.text
            .trim_ascii_start()
            .split(u8::is_ascii_whitespace)
            .next()
            .unwrap_or_default()
    }

    /// The beginning of the line, fit for an error message.
    pub(super) fn shown(&self) -> String {
        shown(self.text)
    }
}

/// The first 40 bytes of `text` with control and foreign bytes escaped.
pub(super) fn shown(text: &[u8]) -> String {
    let head = text.trim_ascii();
    head.get(..40).unwrap_or(head).escape_ascii().to_string()
}
