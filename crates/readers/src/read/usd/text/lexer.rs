//! Words, strings and whole values of text USD files.

use std::ops::Range;

use memchr::{memchr, memmem};

use crate::read::CUT_SHORT;
use crate::read::text::shown;
use spherule_frame::ParseError;

/// Reads a file from front to back.
#[derive(Debug, Clone)]
pub(super) struct Lexer<'a> {
    bytes: &'a [u8],
    at: usize,
    end: usize,
}

impl<'a> Lexer<'a> {
    /// The bytes of `range`.
    pub(super) fn new(bytes: &'a [u8], range: Range<usize>) -> Self {
        Self { bytes, at: range.start, end: range.end.min(bytes.len()) }
    }

    pub(super) const fn at(&self) -> usize {
        self.at
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..self.end).unwrap_or_default()
    }

    /// The next byte.
    pub(super) fn peek(&self) -> Option<u8> {
        self.rest().first().copied()
    }

    /// Takes the next byte if it is `byte`, after blanks and comments.
    pub(super) fn take(&mut self, byte: u8) -> bool {
        self.skip_blank();
        let is_next = self.peek() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    /// Takes `byte`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if another one is next.
    pub(super) fn expect(&mut self, byte: u8) -> Result<(), ParseError> {
        if self.take(byte) {
            return Ok(());
        }
        Err(self.unexpected(&format!("`{}`", char::from(byte))))
    }

    /// The error that something else is here than `expected`.
    pub(super) fn unexpected(&self, expected: &str) -> ParseError {
        let rest = self.rest();
        if rest.is_empty() {
            return self.cut_short(expected);
        }
        let line = rest.split(|byte| *byte == b'\n').next().unwrap_or_default();
        let what = format!("{expected} expected, not {}", shown(line));
        ParseError::malformed(self.at, what)
    }

    fn cut_short(&self, expected: &str) -> ParseError {
        let what = format!("{expected} expected: {CUT_SHORT}");
        ParseError::malformed(self.at, what)
    }

    /// Skips white space and comments.
    pub(super) fn skip_blank(&mut self) {
        loop {
            let rest = self.rest();
            let blank = rest.iter().take_while(|byte| byte.is_ascii_whitespace());
            let len = blank.count();
            self.at += len;
            let rest = rest.get(len..).unwrap_or_default();
            let comment = match rest {
                [b'#', ..] | [b'/', b'/', ..] => memchr(b'\n', rest),
                [b'/', b'*', ..] => memmem::find(rest, b"*/").map(|at| at + 2),
                _ => return,
            };
            self.at += comment.unwrap_or(rest.len());
        }
    }

    /// The bytes up to the next that ends words; none if there are none. A type may end with `[]`.
    pub(super) fn word(&mut self) -> Range<usize> {
        self.skip_blank();
        let rest = self.rest();
        let len = rest.iter().take_while(|byte| is_word(**byte)).count();
        let after = rest.get(len..).unwrap_or_default();
        let array = if len > 0 && after.starts_with(b"[]") { 2 } else { 0 };
        let start = self.at;
        self.at += len + array;
        start..self.at
    }

    /// The text of a string without its quotes. Escapes stay as they are.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there is none, or it does not end.
    pub(super) fn string(&mut self) -> Result<Range<usize>, ParseError> {
        self.skip_blank();
        let rest = self.rest();
        let quote = match rest.first() {
            Some(quote @ (b'"' | b'\'')) => *quote,
            _ => return Err(self.unexpected("a string")),
        };
        let width = if rest.starts_with(&[quote; 3]) { 3 } else { 1 };
        let mut len = width;
        loop {
            let rest = rest.get(len..).unwrap_or_default();
            match rest {
                [] => return Err(self.cut_short("the end of a string")),
                [b'\\', ..] => len += 2,
                [byte, ..]
                    if *byte == quote
                        && rest.iter().take(width).all(|b| *b == quote)
                        && rest.len() >= width =>
                {
                    let text = self.at + width..self.at + len;
                    self.at += len + width;
                    return Ok(text);
                }
                _ => len += 1,
            }
        }
    }

    /// Skips the text between `mark` and the next one, with both.
    fn skip_between(&mut self, mark: &[u8], end: &[u8]) -> Result<(), ParseError> {
        let inside = self.rest().get(mark.len()..).unwrap_or_default();
        let Some(len) = memmem::find(inside, end) else {
            return Err(self.cut_short(&format!("`{}`", String::from_utf8_lossy(end))));
        };
        self.at += mark.len() + len + end.len();
        Ok(())
    }

    /// Skips a value: a word, a string, the name of a file, a path, or whatever is between brackets.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there is none, or it does not end.
    pub(super) fn value(&mut self) -> Result<Range<usize>, ParseError> {
        self.skip_blank();
        let start = self.at;
        let mut depth = 0_usize;
        loop {
            let rest = self.rest();
            match rest {
                [] => return Err(self.cut_short("a value")),
                [b'(' | b'[' | b'{', ..] => {
                    depth += 1;
                    self.at += 1;
                }
                [b')' | b']' | b'}', ..] if depth > 0 => {
                    depth -= 1;
                    self.at += 1;
                }
                [b'"' | b'\'', ..] => {
                    self.string()?;
                }
                [b'@', b'@', b'@', ..] => self.skip_between(b"@@@", b"@@@")?,
                [b'@', ..] => self.skip_between(b"@", b"@")?,
                [b'<', ..] => self.skip_between(b"<", b">")?,
                [b'#', ..] | [b'/', b'/' | b'*', ..] if depth > 0 => self.skip_blank(),
                [byte, ..] if is_word(*byte) => {
                    let word = rest.iter().take_while(|byte| is_word(**byte));
                    self.at += word.count();
                }
                _ if depth > 0 => self.at += 1,
                _ => return Err(self.unexpected("a value")),
            }
            // A path may follow the name of a file
            let is_reference = rest.first() == Some(&b'@') && self.peek() == Some(b'<');
            if depth == 0 && !is_reference {
                return Ok(start..self.at);
            }
        }
    }
}

/// Whether a byte is part of a word: of a number, a type, or the name of a property.
const fn is_word(byte: u8) -> bool {
    byte > b' '
        && !matches!(
            byte,
            b'(' | b')'
                | b'['
                | b']'
                | b'{'
                | b'}'
                | b'"'
                | b'\''
                | b'@'
                | b'<'
                | b'>'
                | b'#'
                | b'='
                | b','
                | b';'
                | b'/'
        )
}
