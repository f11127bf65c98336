//! The text body of ascii PLY, turned into little-endian records, some at a time.

use std::str::FromStr;

use super::header::{Element, PlyHeader, Property, shorten};
use crate::read::columns::{GrowingParticles, ParticleLayout};
use crate::read::input::TextInput;
use crate::read::text::words;
use spherule_frame::{MemoryBudget, ParseError, RawParticles, ScalarType};

/// Records that are decoded before they are appended to the arrays.
const BATCH: usize = 4096;

/// Reads the records of `vertices`, an element of `header`, with `layout`.
///
/// # Errors
/// [`ParseError::Malformed`] if the file ends early, or at a line with too few or too many
/// values or with something that is not a number of the declared type; [`ParseError::TooLarge`] beyond `budget`.
pub(super) fn read(
    text: &mut TextInput<'_>,
    header: &PlyHeader,
    vertices: &Element,
    layout: ParticleLayout,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    text.go_to(header.body);
    let before = header.elements.iter();
    for element in before.take_while(|e| !std::ptr::eq(*e, vertices)) {
        skip(text, element)?;
    }
    check_room(text, vertices)?;
    let room = vertices.count.min(most_records(text.left_about(), vertices));
    let mut growing = GrowingParticles::new(layout, room, budget);
    // Records without properties have no lines.
    let lines = if vertices.properties.is_empty() { 0 } else { vertices.count };
    let mut packed = Vec::new();
    let mut left = lines;
    while left > 0 {
        packed.clear();
        let batch = left.min(BATCH);
        for _ in 0..batch {
            let (at, line) = next_line(text, vertices)?;
            pack_line(&mut packed, at, line, vertices)?;
        }
        growing.append(&packed, batch)?;
        left -= batch;
    }
    Ok(growing.into_particles())
}

/// Refuses a count that the rest of the file cannot hold, if that is known.
fn check_room(text: &TextInput<'_>, element: &Element) -> Result<(), ParseError> {
    match text.left() {
        Some(left) if element.count > 0 && element.count > most_records(left, element) => {
            Err(ParseError::malformed(
                text.at(),
                format!(
                    "{} particles of {} values do not fit the {left} bytes left in the file",
                    element.count,
                    element.properties.len(),
                ),
            ))
        }
        _ => Ok(()),
    }
}

/// The most records of `element` that `bytes` bytes can hold.
fn most_records(bytes: usize, element: &Element) -> usize {
    // A value takes a character and the white space after it; only the last may lack that.
    let least = element.properties.len().saturating_mul(2);
    (bytes + 1).checked_div(least).unwrap_or(usize::MAX)
}

/// Skips the lines of `element`.
///
/// # Errors
/// [`ParseError::Malformed`] if the file ends before.
pub(super) fn skip(text: &mut TextInput<'_>, element: &Element) -> Result<(), ParseError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        next_line(text, element)?;
    }
    Ok(())
}

/// The next line with something on it, and its offset. It is for a record of `element`.
///
/// # Errors
/// [`ParseError::Malformed`] at the end of the file.
pub(super) fn next_line<'t>(
    text: &'t mut TextInput<'_>,
    element: &Element,
) -> Result<(usize, &'t [u8]), ParseError> {
    loop {
        let at = text.at();
        let Some(len) = text.line_len() else {
            return Err(ParseError::malformed(
                at,
                format!("file ends before {} lines of element {}", element.count, element.name),
            ));
        };
        let is_blank = text.rest().get(..len).unwrap_or_default().trim_ascii().is_empty();
        if !is_blank {
            return Ok((at, text.take_line(len)));
        }
        text.advance(len + 1);
    }
}

fn pack_line(
    packed: &mut Vec<u8>,
    at: usize,
    line: &[u8],
    element: &Element,
) -> Result<(), ParseError> {
    let mut words = words(line);
    for property in &element.properties {
        let short = || too_short(at, property, element);
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
        Some(_) => Err(too_long(at, element)),
    }
}

/// The error for a line that ends before `property`.
pub(super) fn too_short(at: usize, property: &Property, element: &Element) -> ParseError {
    let what = format!("line ends before {} of {}", property.name, element.name);
    ParseError::malformed(at, what)
}

/// The error for a line that goes on after all properties.
pub(super) fn too_long(at: usize, element: &Element) -> ParseError {
    ParseError::malformed(
        at,
        format!(
            "line has more values than the {} properties of {}",
            element.properties.len(),
            element.name
        ),
    )
}

/// The error for a word that is not a number of the type of `property`.
pub(super) fn bad_word(at: usize, word: &[u8], property: &Property) -> ParseError {
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
    #[expect(clippy::cast_possible_truncation, reason = "checked to be whole and within 53 bits")]
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
