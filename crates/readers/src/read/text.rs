//! What the readers of text share: lines with their byte offsets, and numbers in all the spellings
//! that simulation programs print.
//!
//! The module `table` builds the parallel row parser on this; which line means what is left to the
//! format's own module.

use std::borrow::Cow;
use std::ops::Range;

use memchr::memchr;

/// One line without its line end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a> {
    /// Offset of the first byte from the start of the file.
    pub at: usize,
    /// The bytes, without `\n` or `\r\n`.
    pub text: &'a [u8],
}

impl Line<'_> {
    /// True if there is nothing but blanks.
    pub(super) fn is_blank(&self) -> bool {
        self.text.trim_ascii().is_empty()
    }
}

/// Walks over the lines of a part of a file.
#[derive(Debug, Clone)]
pub struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    end: usize,
}

impl<'a> Lines<'a> {
    /// The lines in `span` of the file `bytes`; a span beyond the file is cut.
    pub fn new(bytes: &'a [u8], span: Range<usize>) -> Self {
        let end = span.end.min(bytes.len());
        let at = span.start.min(end);
        Self { bytes, at, end }
    }

    /// Offset of the next line.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// True if no bytes are left.
    pub(super) fn is_at_end(&self) -> bool {
        self.at >= self.end
    }

    /// What was not walked over yet.
    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..self.end).unwrap_or_default()
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let at = self.at;
        let text = match memchr(b'\n', rest) {
            Some(newline) => {
                self.at += newline + 1;
                &rest[..newline]
            }
            None => {
                self.at = self.end;
                rest
            }
        };
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        Some(Line { at, text })
    }
}

/// The parts of `text` between blanks and tabs.
pub fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// `bytes` as text of the same length, so that offsets in it are offsets in the file: each byte that is no
/// UTF-8 becomes a question mark.
pub(super) fn same_length(bytes: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = str::from_utf8(bytes) {
        return Cow::Borrowed(text);
    }
    let mut text = String::with_capacity(bytes.len());
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|_| '?'));
    }
    Cow::Owned(text)
}

/// Bytes of a file as a message can show them: quoted, lossy, at most 24 characters.
pub fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes.get(..96).unwrap_or(bytes));
    let text = text.trim();
    match text.char_indices().nth(24) {
        Some((cut, _)) => format!("{:?}...", &text[..cut]),
        None => format!("{text:?}"),
    }
}

/// `token` as a decimal integer with an optional sign. `-0` is none: only a float has it.
pub fn integer(token: &[u8]) -> Option<i64> {
    let (negative, digits) = match token {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() {
        return None;
    }
    // Accumulated below zero, where i64 reaches one further.
    let mut value: i64 = 0;
    for digit in digits {
        if !digit.is_ascii_digit() {
            return None;
        }
        value = value.checked_mul(10)?.checked_sub(i64::from(digit - b'0'))?;
    }
    if negative { (value != 0).then_some(value) } else { value.checked_neg() }
}

/// `token` as a number: decimal and exponent forms, Fortran's `1.0D+00` and `1.0-105`, and NaN or
/// infinity as C, Fortran and Microsoft's runtime print them.
///
/// `fast_float2` takes nearly all of them: 13 ns for a number of a LAMMPS dump, where `str::parse`
/// needs 18 ns and UTF-8 (one core of the development machine).
pub fn number(token: &[u8]) -> Option<f64> {
    match fast_float2::parse(token) {
        Ok(value) => Some(value),
        Err(_) => unusual_number(token),
    }
}

/// [`number`] that takes a comma for the decimal point, as European spreadsheets write it.
pub(super) fn number_with_comma(token: &[u8]) -> Option<f64> {
    let Some(comma) = memchr(b',', token) else {
        return number(token);
    };
    // `1,` is a number followed by a separator rather than a number.
    if !token.get(comma + 1).is_some_and(u8::is_ascii_digit) || token.contains(&b'.') {
        return None;
    }
    let mut buffer = [0; LONGEST];
    let copy = buffer.get_mut(..token.len())?;
    copy.copy_from_slice(token);
    copy[comma] = b'.';
    number(copy)
}

/// Longest spelling of a number that is rewritten before parsing.
const LONGEST: usize = 64;

/// The spellings that no float parser of today knows.
fn unusual_number(token: &[u8]) -> Option<f64> {
    let (negative, body) = match token {
        [b'-', body @ ..] => (true, body),
        [b'+', body @ ..] => (false, body),
        body => (false, body),
    };
    if !body.is_empty() && body.iter().all(|b| *b == b'*') {
        return Some(f64::NAN); // Fortran's field was too narrow
    }
    if body.len() >= 3 && body[..3].eq_ignore_ascii_case(b"nan") {
        // `nan(ind)`, `nanq`, `nans`
        let tail = &body[3..];
        let known = tail.starts_with(b"(") && tail.ends_with(b")")
            || tail.eq_ignore_ascii_case(b"q")
            || tail.eq_ignore_ascii_case(b"s");
        return known.then_some(f64::NAN);
    }
    if let Some(hash) = memchr(b'#', body) {
        return microsoft_number(&body[..hash], &body[hash + 1..], negative);
    }
    fortran_number(token)
}

/// `1.#IND`, `1.#QNAN`, `1.#INF` and their like, with or without zeros before and after.
fn microsoft_number(before: &[u8], after: &[u8], negative: bool) -> Option<f64> {
    if before != b"1." {
        return None;
    }
    let name = after.to_ascii_uppercase();
    let is = |keyword: &[u8]| {
        name.strip_prefix(keyword).is_some_and(|rest| rest.iter().all(u8::is_ascii_digit))
    };
    // The short forms come from rounding `INF` and `QNAN` to few digits as if they were some.
    if is(b"INF") || is(b"J") || is(b"IO") {
        return Some(if negative { f64::NEG_INFINITY } else { f64::INFINITY });
    }
    let is_nan = is(b"IND") || is(b"QNAN") || is(b"SNAN") || is(b"NAN") || is(b"R");
    is_nan.then_some(f64::NAN)
}

/// `1.0D+00`, and `1.0-105`, where three digits of exponent left no room for the letter.
fn fortran_number(token: &[u8]) -> Option<f64> {
    let digits_before = |at: usize| token[..at].iter().any(u8::is_ascii_digit);
    let mut buffer = [0; LONGEST];
    if let Some(letter) = token.iter().position(|b| matches!(b, b'd' | b'D' | b'q' | b'Q')) {
        let copy = buffer.get_mut(..token.len())?;
        copy.copy_from_slice(token);
        copy[letter] = b'e';
        return digits_before(letter).then(|| fast_float2::parse(&*copy).ok()).flatten();
    }
    let sign = token.iter().rposition(|b| matches!(b, b'+' | b'-'))?;
    if !digits_before(sign) || !token[sign - 1].is_ascii_digit() && token[sign - 1] != b'.' {
        return None;
    }
    let copy = buffer.get_mut(..=token.len())?;
    copy[..sign].copy_from_slice(&token[..sign]);
    copy[sign] = b'e';
    copy[sign + 1..].copy_from_slice(&token[sign..]);
    fast_float2::parse(&*copy).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn parses_numbers_in_every_notation() {
        let cases: [(&str, f64); 20] = [
            ("1", 1.0),
            ("+1.5", 1.5),
            ("-.5", -0.5),
            ("5.", 5.0),
            ("1e-3", 1e-3),
            ("1.0D+00", 1.0),
            ("-2.5d-01", -0.25),
            ("1.0Q2", 100.0),
            ("1.25-105", 1.25e-105),
            ("-1.25+105", -1.25e105),
            ("inf", f64::INFINITY),
            ("-Infinity", f64::NEG_INFINITY),
            ("+INF", f64::INFINITY),
            ("1.#INF", f64::INFINITY),
            ("-1.#INF00", f64::NEG_INFINITY),
            ("-1.#J", f64::NEG_INFINITY),
            ("4.9e-324", 4.9e-324),
            ("1e400", f64::INFINITY),
            ("-0", -0.0),
            ("1e-400", 0.0),
        ];
        for (text, expected) in cases {
            let found = number(text.as_bytes());
            assert_eq!(found.map(f64::to_bits), Some(expected.to_bits()), "{text}: {found:?}");
        }
        for text in [
            "nan",
            "NaN",
            "-nan",
            "-1.#IND",
            "1.#QNAN",
            "1.#IND00",
            "nan(ind)",
            "-nan(snan)",
            "NaNQ",
            "****",
            "1.#R",
        ] {
            assert!(number(text.as_bytes()).is_some_and(f64::is_nan), "{text}");
        }
    }

    #[test]
    fn rejects_text_that_is_not_a_number() {
        for text in [
            "", "-", "+", ".", "e5", "d5", "H", "In", "Na", "Nd", "D", "1.0x", "1,5", "--1", "+-1",
            "1-", "1.0e", "1.#XYZ", "2.#INF", "nanx", "0x10", "1 2", "-d", "1e5-3", "é",
        ] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn decimal_commas() {
        assert_eq!(number_with_comma(b"-1,5E-1"), Some(-0.15));
        assert_eq!(number_with_comma(b"1.5"), Some(1.5));
        for text in ["1,", "1.000,5", "1,000,5", ",", "a,5"] {
            assert_eq!(number_with_comma(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn integers_stay_exact() {
        assert_eq!(integer(b"9223372036854775807"), Some(i64::MAX));
        assert_eq!(integer(b"-9223372036854775808"), Some(i64::MIN));
        assert_eq!(integer(b"+12"), Some(12));
        for text in ["9223372036854775808", "-0", "", "-", "1.0", "1e3", "1 "] {
            assert_eq!(integer(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn lines_have_their_offset() {
        let bytes = b"ab\r\n\n c\nlast";
        let found: Vec<_> = Lines::new(bytes, 0..bytes.len()).map(|l| (l.at, l.text)).collect();
        let expected: [(usize, &[u8]); 4] = [(0, b"ab"), (4, b""), (5, b" c"), (8, b"last")];
        assert_eq!(found, expected);
        assert_eq!(Lines::new(bytes, 40..70).next(), None);
    }

    #[test]
    fn long_tokens_are_shortened() {
        assert_eq!(shown(b" ab\x01 "), "\"ab\\u{1}\"");
        assert!(shown(&[b'x'; 1000]).len() < 40);
    }

    proptest! {
        #![proptest_config(crate::read::text_samples::config())]

        #[test]
        fn printed_numbers_round_trip(value: f64) {
            for text in [format!("{value}"), format!("{value:e}"), format!("{value:E}").replace('E', "D")] {
                let found = number(text.as_bytes()).expect("a printed number");
                prop_assert!(found.to_bits() == value.to_bits() || value.is_nan() && found.is_nan());
            }
        }

        #[test]
        fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(prop::sample::select(b"0123456789+-.,eEdDqnaif#IND()* ".to_vec()), 0..80)) {
            let _ = (number(&bytes), number_with_comma(&bytes), integer(&bytes), shown(&bytes));
        }
    }
}
