//! Numbers written as text, for the ASCII variants of both VTK formats: free-form, any number a
//! line, with the odd spellings of NaN and infinity that C libraries print.

use crate::read::input::TextInput;
use spherule_frame::{AttributeData, MemoryBudget, ParseError, ScalarType, with_number_type};

/// [`read_values`] of `text` from byte `at` on; returns them and the byte after the last.
///
/// # Errors
/// As [`read_values`].
pub(in crate::read) fn parse_values(
    text: &[u8],
    at: usize,
    count: usize,
    scalar: ScalarType,
) -> Result<(AttributeData, usize), ParseError> {
    let mut text = TextInput::whole(text);
    text.go_to(at);
    let data = read_values(&mut text, count, scalar, MemoryBudget::UNLIMITED)?;
    Ok((data, text.at()))
}

/// Parses the next `count` numbers of `text`, of type `scalar`.
///
/// # Errors
/// [`ParseError::Malformed`] if there are fewer, or one is not a number of that type; nothing is
/// allocated for a count that the text cannot hold. [`ParseError::TooLarge`] if they take more than `budget`.
pub(super) fn read_values(
    text: &mut TextInput<'_>,
    count: usize,
    scalar: ScalarType,
    budget: MemoryBudget,
) -> Result<AttributeData, ParseError> {
    check_room(text, count)?;
    with_number_type!(scalar, Number => {
        Ok(read_numbers::<Number>(text, count, budget)?.into())
    })
}

/// Skips the next `count` words.
///
/// # Errors
/// [`ParseError::Malformed`] if there are fewer.
pub(super) fn skip_words(text: &mut TextInput<'_>, count: usize) -> Result<(), ParseError> {
    check_room(text, count)?;
    each_word(text, count, |_, _| Ok(()))
}

/// Skips about `count` integers, up to the next word that is none. Some writers count the cells of a section wrongly,
/// and VTK reads such files.
///
/// # Errors
/// [`ParseError::Malformed`] if the text ends before that many.
pub(super) fn skip_integers(text: &mut TextInput<'_>, count: usize) -> Result<(), ParseError> {
    let is_integer = |word: &[u8]| word.iter().all(|b| b.is_ascii_digit() || *b == b'-');
    let mut done = 0;
    loop {
        let at = text.at();
        let near = text.words(count.saturating_sub(done).max(1));
        let len = near.len();
        let mut words = Words { text: near, at: 0 };
        let mut used = 0;
        while words.next().is_some_and(is_integer) {
            used = words.at;
            done += 1;
        }
        let is_at_end = near[used..].trim_ascii().is_empty();
        text.advance(if is_at_end { len } else { used });
        if len == 0 && done < count {
            return Err(ends_after(at, done, count));
        }
        if len == 0 || !is_at_end {
            return Ok(());
        }
    }
}

/// Refuses a count that the rest of the file cannot hold, if that is known.
fn check_room(text: &TextInput<'_>, count: usize) -> Result<(), ParseError> {
    match text.left() {
        // A number takes a digit and a separator at least.
        Some(left) if count > left.div_ceil(2) => Err(too_few(text.at(), count, left)),
        _ => Ok(()),
    }
}

/// Passes the next `count` words with their offsets to a callback, and stops after the last.
fn each_word(
    text: &mut TextInput<'_>,
    count: usize,
    mut show: impl FnMut(usize, &[u8]) -> Result<(), ParseError>,
) -> Result<(), ParseError> {
    let mut done = 0;
    while done < count {
        let at = text.at();
        let near = text.words(count - done);
        if near.is_empty() {
            return Err(ends_after(at, done, count));
        }
        let mut words = Words { text: near, at: 0 };
        while done < count
            && let Some(word) = words.next()
        {
            show(at + words.at - word.len(), word)?;
            done += 1;
        }
        let used = if done < count { near.len() } else { words.at };
        text.advance(used);
    }
    Ok(())
}

fn too_few(at: usize, count: usize, left: usize) -> ParseError {
    ParseError::malformed(at, format!("expected {count} numbers, {left} bytes are left"))
}

fn ends_after(at: usize, done: usize, count: usize) -> ParseError {
    ParseError::malformed(at, format!("expected {count} numbers, the text ends after {done}"))
}

/// Words with a position: after each, `at` is the byte after it.
struct Words<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.text.get(self.at..)?;
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let word = rest.get(start..)?;
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.at += start + length;
        word.get(..length)
    }
}

fn read_numbers<T: Number>(
    text: &mut TextInput<'_>,
    count: usize,
    budget: MemoryBudget,
) -> Result<Vec<T>, ParseError> {
    let most = usize::try_from(budget.bytes()).unwrap_or(usize::MAX) / size_of::<T>();
    let mut values = Vec::new();
    let room = count.min(text.left_about().div_ceil(2)).min(most);
    // Pages that are not used cost nothing.
    let _ = values.try_reserve_exact(room);
    each_word(text, count, |at, word| {
        let parsed = std::str::from_utf8(word).ok().and_then(T::parse);
        let Some(value) = parsed else {
            let shown = word.get(..24).unwrap_or(word).escape_ascii();
            return Err(ParseError::malformed(
                at,
                format!("`{shown}` is not a number of type {}", T::NAME),
            ));
        };
        if values.len() == most {
            return Err(budget.exceeded("its numbers in memory are"));
        }
        values.push(value);
        Ok(())
    })?;
    values.shrink_to_fit();
    Ok(values)
}

trait Number: Sized {
    const NAME: &str;
    fn parse(word: &str) -> Option<Self>;
}

impl Number for f32 {
    const NAME: &str = "f32";
    fn parse(word: &str) -> Option<Self> {
        #[expect(clippy::cast_possible_truncation, reason = "rounds to the asked type")]
        word.parse().ok().or_else(|| odd_float(word).map(|v| v as f32))
    }
}

impl Number for f64 {
    const NAME: &str = "f64";
    fn parse(word: &str) -> Option<Self> {
        word.parse().ok().or_else(|| odd_float(word))
    }
}

macro_rules! integer_number {
    ($($ty:ty),*) => {$(
        impl Number for $ty {
            const NAME: &str = stringify!($ty);
            fn parse(word: &str) -> Option<Self> {
                word.parse().ok().or_else(|| integer_as_float(word)?.try_into().ok())
            }
        }
    )*};
}
integer_number!(i8, u8, i16, u16, i32, u32, i64, u64);

/// Integers that a writer printed as floats: `12.0`, `1e6`.
fn integer_as_float(word: &str) -> Option<i64> {
    // Up to here every integer is exact in f64.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let value: f64 = word.parse().ok()?;
    #[expect(clippy::cast_possible_truncation, reason = "whole and within 2^53")]
    (value.fract() == 0.0 && value.abs() <= EXACT).then_some(value as i64)
}

/// Spellings beyond Rust's: `-1.#IND`, `1.#QNAN`, `1.#INF` and `nan(ind)` of Microsoft's C library,
/// `1.0D+00` of Fortran.
fn odd_float(word: &str) -> Option<f64> {
    let lower = word.to_ascii_lowercase();
    let negative = lower.starts_with('-');
    if lower.contains("#inf") {
        return Some(if negative { f64::NEG_INFINITY } else { f64::INFINITY });
    }
    if ["#ind", "#qnan", "#snan", "nan("].iter().any(|m| lower.contains(m)) {
        return Some(f64::NAN);
    }
    lower.contains('d').then(|| lower.replace('d', "e").parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusual_notations_are_parsed() {
        let text = b"nan -inf -1.#IND 1.#INF -1.#INF00 -nan(ind) 1.5D+01 Infinity";
        let (data, end) = parse_values(text, 0, 8, ScalarType::F32).unwrap();
        let AttributeData::F32(v) = data else { panic!("not f32") };
        assert!(v[0].is_nan() && v[2].is_nan() && v[5].is_nan());
        assert_eq!((v[1], v[3], v[4]), (f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY));
        assert_eq!((v[6], v[7]), (15.0, f32::INFINITY));
        assert_eq!(end, text.len());
    }

    #[test]
    fn integers_stay_exact_and_in_range() {
        let (data, _) = parse_values(b"18446744073709551615 12.0", 0, 2, ScalarType::U64).unwrap();
        assert_eq!(data, AttributeData::U64(vec![u64::MAX, 12]));
        assert!(parse_values(b"256", 0, 1, ScalarType::U8).is_err());
        assert!(parse_values(b"-1", 0, 1, ScalarType::U32).is_err());
        assert!(parse_values(b"1.5", 0, 1, ScalarType::I32).is_err());
    }

    #[test]
    fn counts_beyond_the_text_are_rejected_early() {
        assert!(parse_values(b"1 2 3", 0, usize::MAX, ScalarType::F64).is_err());
        assert!(parse_values(b"1  2 ", 0, 3, ScalarType::F64).is_err());
        assert!(skip_words(&mut TextInput::whole(b"1 2 3"), usize::MAX).is_err());
        let mut text = TextInput::whole(b"1 2 3");
        assert_eq!(skip_words(&mut text, 2), Ok(()));
        assert_eq!(text.at(), 3);
    }
}
