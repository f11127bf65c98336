//! Houdini's JSON as text (`.geo`): the tokens of binary JSON without its arrays of one type.
//!
//! Commas and colons count as white space: the layout of geometry tells names from values.

use super::tokens::{Token, Value};
use crate::read::CUT_SHORT;
use spherule_frame::ParseError;

/// Most bytes of a word in a message.
const SHOWN: usize = 40;

/// Whether a file that begins with `head` is geometry in text: a list whose first name is that of the version.
pub(super) fn is_geometry(head: &[u8]) -> bool {
    let list = head.trim_ascii_start().strip_prefix(b"[").map(<[u8]>::trim_ascii_start);
    list.is_some_and(|list| list.starts_with(b"\"fileversion\""))
}

/// Reads token after token.
pub(super) struct TextTokens<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> TextTokens<'a> {
    /// Before the first token of `bytes`.
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next token.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the file ends, or has no token here.
    pub(super) fn next(&mut self) -> Result<Token<'a>, ParseError> {
        let is_space = |b: &&u8| b.is_ascii_whitespace() || matches!(b, b',' | b':');
        self.at += self.rest().iter().take_while(is_space).count();
        let at = self.at;
        let value = match self.rest().first() {
            None => {
                let what = format!("the list of the geometry does not end: {CUT_SHORT}");
                return Err(ParseError::malformed(at, what));
            }
            Some(b'[' | b'{') => self.mark(Value::Begin),
            Some(b']' | b'}') => self.mark(Value::End),
            Some(b'"') => self.text()?,
            Some(_) => self.word()?,
        };
        Ok(Token { at, value })
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    const fn mark(&mut self, value: Value<'a>) -> Value<'a> {
        self.at += 1;
        value
    }

    /// A string, with its escapes as they are.
    fn text(&mut self) -> Result<Value<'a>, ParseError> {
        let start = self.at + 1;
        let text = self.bytes.get(start..).unwrap_or_default();
        let mut is_escaped = false;
        let end = text.iter().position(|byte| {
            let is_end = *byte == b'"' && !is_escaped;
            is_escaped = *byte == b'\\' && !is_escaped;
            is_end
        });
        let Some(text) = end.and_then(|end| text.get(..end)) else {
            let what = format!("a string does not end: {CUT_SHORT}");
            return Err(ParseError::malformed(self.at, what));
        };
        self.at = start + text.len() + 1;
        Ok(Value::Text(text))
    }

    /// A number, a truth value or nothing.
    fn word(&mut self) -> Result<Value<'a>, ParseError> {
        let is_inside =
            |b: &&u8| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.' | b'_');
        let rest = self.rest();
        let len = rest.iter().take_while(is_inside).count();
        let word = rest.get(..len).and_then(|word| std::str::from_utf8(word).ok()).unwrap_or("");
        let value = match word {
            "true" => Value::Bool(true),
            "false" => Value::Bool(false),
            "null" => Value::Null,
            // As an integer it would lose its sign
            "-0" => Value::Real(-0.0),
            number => {
                let integer = number.parse().ok().map(Value::Integer);
                let number = integer.or_else(|| number.parse().ok().map(Value::Real));
                number.ok_or_else(|| self.no_token(rest))?
            }
        };
        self.at += len;
        Ok(value)
    }

    fn no_token(&self, rest: &[u8]) -> ParseError {
        let is_end = |b: &u8| b.is_ascii_whitespace() || matches!(b, b',' | b']' | b'}');
        let len = rest.iter().take(SHOWN).position(is_end).unwrap_or(SHOWN.min(rest.len()));
        let word = String::from_utf8_lossy(&rest[..len]).escape_default().to_string();
        let what =
            format!("`{word}` is not a number, a string or a list: the file is damaged here");
        ParseError::malformed(self.at, what)
    }
}
