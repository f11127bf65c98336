//! The text body of ascii PLY, turned into little-endian records.

use std::str::FromStr;

use super::header::{Element, Property, shorten};
use crate::{ParseError, ScalarType};

/// Walks the lines of the body; blank ones do not count.
pub(super) struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Text<'a> {
    /// The text from byte `at` on.
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// Skips the lines of `element`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the file ends before.
    pub(super) fn skip(&mut self, element: &Element) -> Result<(), ParseError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for _ in 0..element.count {
            self.line(element)?;
        }
        Ok(())
    }

    /// The scalars of all records of `element` as packed little-endian numbers.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the file ends early, or at a line with too few or too many
    /// values or with something that is no number of the declared type.
    pub(super) fn pack(&mut self, element: &Element) -> Result<Vec<u8>, ParseError> {
        // A value takes a character and the white space after it; only the last may lack that.
        let least = element.properties.len().saturating_mul(2);
        let left = self.bytes.len().saturating_sub(self.at) + 1;
        if !matches!(element.count.checked_mul(least), Some(need) if need <= left || element.count == 0)
        {
            return Err(ParseError::malformed(
                self.at,
                format!(
                    "{} particles of {} values do not fit the {} bytes left in the file",
                    element.count,
                    element.properties.len(),
                    left - 1
                ),
            ));
        }
        let mut packed = Vec::with_capacity(element.count * element.scalar_bytes());
        if element.properties.is_empty() {
            return Ok(packed);
        }
        for _ in 0..element.count {
            let (at, line) = self.line(element)?;
            pack_line(&mut packed, at, line, element)?;
        }
        Ok(packed)
    }

    /// The next line with something on it, and its offset.
    fn line(&mut self, element: &Element) -> Result<(usize, &'a [u8]), ParseError> {
        loop {
            let rest = self.bytes.get(self.at..).unwrap_or_default();
            if rest.is_empty() {
                return Err(ParseError::malformed(
                    self.at,
                    format!(
                        "file ends before {} lines of element {}",
                        element.count, element.name
                    ),
                ));
            }
            let len = rest
                .iter()
                .position(|b| matches!(b, b'\n' | b'\r'))
                .unwrap_or(rest.len());
            let start = self.at;
            self.at += (len + 1).min(rest.len());
            let line = rest.get(..len).unwrap_or_default();
            if !line.trim_ascii().is_empty() {
                return Ok((start, line));
            }
        }
    }
}

fn pack_line(
    packed: &mut Vec<u8>,
    at: usize,
    line: &[u8],
    element: &Element,
) -> Result<(), ParseError> {
    let mut words = line
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty());
    for property in &element.properties {
        let short = || {
            ParseError::malformed(
                at,
                format!("line ends before {} of {}", property.name, element.name),
            )
        };
        let word = words.next().ok_or_else(short)?;
        if property.length.is_none() {
            push_number(packed, word, property.scalar)
                .ok_or_else(|| bad_word(at, word, property))?;
            continue;
        }
        let items: usize = parse(word).ok_or_else(|| bad_word(at, word, property))?;
        for _ in 0..items {
            words.next().ok_or_else(short)?;
        }
    }
    match words.next() {
        None => Ok(()),
        Some(_) => Err(ParseError::malformed(
            at,
            format!(
                "line has more values than the {} properties of {}",
                element.properties.len(),
                element.name
            ),
        )),
    }
}

fn bad_word(at: usize, word: &[u8], property: &Property) -> ParseError {
    ParseError::malformed(
        at,
        format!(
            "{} is `{}`, not {}",
            property.name,
            shorten(&String::from_utf8_lossy(word)),
            property.scalar.name()
        ),
    )
}

fn parse<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

/// Appends `word` as a little-endian number of type `scalar`; `None` if it is none.
fn push_number(packed: &mut Vec<u8>, word: &[u8], scalar: ScalarType) -> Option<()> {
    macro_rules! integer {
        ($ty:ty) => {{
            let number: $ty = parse(word).or_else(|| whole_number(word)?.try_into().ok())?;
            packed.extend_from_slice(&number.to_le_bytes());
        }};
    }
    match scalar {
        ScalarType::I8 => integer!(i8),
        ScalarType::U8 => integer!(u8),
        ScalarType::I16 => integer!(i16),
        ScalarType::U16 => integer!(u16),
        ScalarType::I32 => integer!(i32),
        ScalarType::U32 => integer!(u32),
        ScalarType::I64 => integer!(i64),
        ScalarType::U64 => integer!(u64),
        ScalarType::F32 => {
            let number: f32 = parse(word).or_else(|| c_special(word))?;
            packed.extend_from_slice(&number.to_le_bytes());
        }
        ScalarType::F64 => {
            let number = parse(word).or_else(|| c_special(word).map(f64::from))?;
            packed.extend_from_slice(&number.to_le_bytes());
        }
    }
    Some(())
}

/// An integer that was written as a float, such as `255.0` or `1e3`.
fn whole_number(word: &[u8]) -> Option<i64> {
    /// Beyond this an f64 is no longer sure to be the number that was meant.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let number: f64 = parse(word)?;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "checked to be whole and within 53 bits"
    )]
    (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
}

/// Spellings of infinity and NaN that come from C libraries: `1.#INF`, `-1.#IND`, `-nan(ind)`.
fn c_special(word: &[u8]) -> Option<f32> {
    let word = str::from_utf8(word).ok()?.to_ascii_lowercase();
    let (sign, word) = match word.strip_prefix('-') {
        Some(word) => (-1.0, word),
        None => (1.0, word.as_str()),
    };
    if word.starts_with("1.#inf") {
        Some(sign * f32::INFINITY)
    } else if word.starts_with("1.#") || word.starts_with("nan(") {
        Some(f32::NAN)
    } else {
        None
    }
}
