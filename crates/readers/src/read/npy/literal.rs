//! The subset of Python literals that NPY headers are written in: strings, integers, booleans,
//! `None`, tuples, lists and dictionaries.

use spherule_frame::ParseError;

/// Deeper nesting than any real dtype; it bounds the recursion.
const MAX_DEPTH: usize = 32;

/// A parsed literal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Literal {
    /// `'text'` or `"text"`.
    Text(String),
    /// `12`, `-1` or `12L`.
    Integer(i128),
    /// `True`, `False`.
    Bool(bool),
    /// `None`.
    None,
    /// A tuple or a list; headers use both for the same things.
    Sequence(Vec<Literal>),
    /// `{key: value, ...}` in order of appearance.
    Dict(Vec<(Literal, Literal)>),
}

/// Parses one literal; white space may follow it. `place` returns the offset in the file of what follows a
/// part of `text`.
///
/// # Errors
/// [`ParseError::Malformed`] at the character that does not fit.
pub(super) fn parse(text: &str, place: impl Fn(&str) -> usize) -> Result<Literal, ParseError> {
    let place = &place;
    let mut parser = LiteralParser { text, at: 0, place };
    let value = parser.value(0)?;
    parser.skip_space();
    if parser.at < text.len() {
        return Err(parser.error("the end of the npy header"));
    }
    Ok(value)
}

struct LiteralParser<'a> {
    text: &'a str,
    at: usize,
    place: &'a dyn Fn(&str) -> usize,
}

impl LiteralParser<'_> {
    fn error(&self, expected: &str) -> ParseError {
        let found: String = self.rest().chars().take(20).collect();
        let before = self.text.get(..self.at).unwrap_or(self.text);
        ParseError::malformed(
            (self.place)(before),
            format!("npy header: expected {expected}, found `{found}`"),
        )
    }

    fn rest(&self) -> &str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|b| b.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// Takes `token` if it comes next.
    fn eat(&mut self, token: &str) -> bool {
        let found = self.rest().starts_with(token);
        if found {
            self.at += token.len();
        }
        found
    }

    fn value(&mut self, depth: usize) -> Result<Literal, ParseError> {
        if depth > MAX_DEPTH {
            return Err(self.error("less nesting"));
        }
        self.skip_space();
        match self.peek() {
            Some(b'(') => self.sequence(b')', depth),
            Some(b'[') => self.sequence(b']', depth),
            Some(b'{') => self.dict(depth),
            Some(b'-' | b'0'..=b'9') => self.integer(),
            _ if self.eat("True") => Ok(Literal::Bool(true)),
            _ if self.eat("False") => Ok(Literal::Bool(false)),
            _ if self.eat("None") => Ok(Literal::None),
            // Python 2 marks strings as unicode or bytes.
            Some(b'u' | b'b' | b'\'' | b'"') => self.string().map(Literal::Text),
            _ => Err(self.error("a value")),
        }
    }

    fn sequence(&mut self, close: u8, depth: usize) -> Result<Literal, ParseError> {
        self.at += 1;
        let mut items = Vec::new();
        loop {
            self.skip_space();
            if self.peek() == Some(close) {
                self.at += 1;
                return Ok(Literal::Sequence(items));
            }
            items.push(self.value(depth + 1)?);
            self.separator(close)?;
        }
    }

    fn dict(&mut self, depth: usize) -> Result<Literal, ParseError> {
        self.at += 1;
        let mut entries = Vec::new();
        loop {
            self.skip_space();
            if self.eat("}") {
                return Ok(Literal::Dict(entries));
            }
            let key = self.value(depth + 1)?;
            self.skip_space();
            if !self.eat(":") {
                return Err(self.error("`:`"));
            }
            let value = self.value(depth + 1)?;
            entries.push((key, value));
            self.separator(b'}')?;
        }
    }

    /// A comma, or the closing bracket (which stays).
    fn separator(&mut self, close: u8) -> Result<(), ParseError> {
        self.skip_space();
        if self.eat(",") || self.peek() == Some(close) {
            Ok(())
        } else {
            Err(self.error("`,` or a closing bracket"))
        }
    }

    fn integer(&mut self) -> Result<Literal, ParseError> {
        let digits_from = usize::from(self.peek() == Some(b'-'));
        let digits = self.rest().bytes().skip(digits_from);
        let len = digits_from + digits.take_while(u8::is_ascii_digit).count();
        let number = self
            .rest()
            .get(..len)
            .and_then(|n| n.parse().ok())
            .ok_or_else(|| self.error("an integer"))?;
        self.at += len;
        // Python 2 wrote long integers as `2000L`.
        self.eat("L");
        Ok(Literal::Integer(number))
    }

    fn string(&mut self) -> Result<String, ParseError> {
        if matches!(self.peek(), Some(b'u' | b'b')) {
            self.at += 1;
        }
        let quote = match self.peek() {
            Some(b'\'') => '\'',
            Some(b'"') => '"',
            _ => return Err(self.error("a string")),
        };
        self.at += 1;
        let mut text = String::new();
        while let Some(c) = self.next_char() {
            match c {
                _ if c == quote => return Ok(text),
                '\\' => text.push(self.escape()?),
                _ => text.push(c),
            }
        }
        Err(self.error("the end of a string"))
    }

    fn next_char(&mut self) -> Option<char> {
        let c = self.rest().chars().next()?;
        self.at += c.len_utf8();
        Some(c)
    }

    fn escape(&mut self) -> Result<char, ParseError> {
        let digits = match self.next_char() {
            Some('n') => return Ok('\n'),
            Some('t') => return Ok('\t'),
            Some('r') => return Ok('\r'),
            Some(c @ ('\\' | '\'' | '"')) => return Ok(c),
            Some('x') => 2,
            Some('u') => 4,
            Some('U') => 8,
            _ => return Err(self.error("a known escape")),
        };
        let code = self.rest().get(..digits);
        let c = code
            .and_then(|code| u32::from_str_radix(code, 16).ok())
            .and_then(char::from_u32)
            .ok_or_else(|| self.error("hexadecimal digits of a character"))?;
        self.at += digits;
        Ok(c)
    }
}
