//! Walks through Houdini's JSON: names and values, elements of arrays.

use super::binary_json::{self, BinaryTokens};
use super::text_json::{self, TextTokens};
use super::tokens::{Token, Value, unexpected};
use spherule_frame::{Endian, MemoryBudget, ParseError};

/// Byte order of the numbers in arrays of the file that begins with `head`; `None` if that is no geometry. Text has no such
/// arrays.
pub(super) fn endian(head: &[u8]) -> Option<Endian> {
    binary_json::endian(head).or_else(|| text_json::is_geometry(head).then_some(Endian::Little))
}

/// Reads token after token.
pub(super) struct JsonCursor<'a> {
    tokens: Tokens<'a>,
    pub(super) endian: Endian,
}

/// Where tokens come from.
enum Tokens<'a> {
    Binary(BinaryTokens<'a>),
    Text(TextTokens<'a>),
}

impl<'a> JsonCursor<'a> {
    /// Before the first token of `bytes`. Definitions of names take no more than `budget`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if `bytes` are no geometry.
    pub(super) fn new(bytes: &'a [u8], budget: MemoryBudget) -> Result<Self, ParseError> {
        let endian = endian(bytes).ok_or_else(|| {
            let what = "not geometry of Houdini: the file begins neither with \\x7fNSJb, as binary JSON, nor with a list \
                        with \"fileversion\", as text";
            ParseError::malformed(0, what)
        })?;
        let tokens = if binary_json::endian(bytes).is_some() {
            Tokens::Binary(BinaryTokens::new(bytes, endian, budget))
        } else {
            Tokens::Text(TextTokens::new(bytes))
        };
        Ok(Self { tokens, endian })
    }

    /// The next token.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the file ends, or has no token here.
    pub(super) fn next(&mut self) -> Result<Token<'a>, ParseError> {
        match &mut self.tokens {
            Tokens::Binary(tokens) => tokens.next(),
            Tokens::Text(tokens) => tokens.next(),
        }
    }

    /// Skips the rest of the value that begins with `token`.
    ///
    /// # Errors
    /// As [`Self::next`].
    pub(super) fn skip(&mut self, token: Token<'a>) -> Result<(), ParseError> {
        let mut depth = usize::from(matches!(token.value, Value::Begin));
        while depth > 0 {
            match self.next()?.value {
                Value::Begin => depth += 1,
                Value::End => depth -= 1,
                _ => {}
            }
        }
        Ok(())
    }

    /// Calls `each` with the names and values of the map, or list of pairs, that `token` begins. `each` reads the rest
    /// of a value.
    ///
    /// # Errors
    /// As [`Self::next`]; [`ParseError::Malformed`] for anything else; errors of `each`.
    pub(super) fn pairs(
        &mut self,
        token: Token<'a>,
        mut each: impl FnMut(&mut Self, &'a [u8], Token<'a>) -> Result<(), ParseError>,
    ) -> Result<(), ParseError> {
        if !matches!(token.value, Value::Begin) {
            return Err(unexpected(token.at, "names and values"));
        }
        loop {
            let key = self.next()?;
            match key.value {
                Value::End => return Ok(()),
                Value::Text(name) => {
                    let value = self.next()?;
                    if matches!(value.value, Value::End) {
                        return Err(unexpected(value.at, "a value"));
                    }
                    each(self, name, value)?;
                }
                _ => return Err(unexpected(key.at, "a name")),
            }
        }
    }

    /// Calls `each` with the elements of the array that `token` begins and their indices. `each` reads the rest of an
    /// element.
    ///
    /// # Errors
    /// As [`Self::pairs`].
    pub(super) fn elements(
        &mut self,
        token: Token<'a>,
        mut each: impl FnMut(&mut Self, usize, Token<'a>) -> Result<(), ParseError>,
    ) -> Result<(), ParseError> {
        if !matches!(token.value, Value::Begin) {
            return Err(unexpected(token.at, "an array"));
        }
        let mut index = 0;
        loop {
            let element = self.next()?;
            if matches!(element.value, Value::End) {
                return Ok(());
            }
            each(self, index, element)?;
            index += 1;
        }
    }
}
