//! The text body of ascii PLY, turned into little-endian records, some at a time.

use super::header::{Element, PlyHeader, Property, shorten};
use crate::read::columns::{GrowingParticles, ParticleLayout};
use crate::read::input::TextInput;
use crate::read::text::words;
use crate::read::typed_text::{parse, push_number};
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

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
