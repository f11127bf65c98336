//! `.xyz`: three unrelated formats under one extension; [`kind`] decides.
//!
//! Raw triples of f32 as splashsurf reads and writes them; molecular text with its extended form
//! (the columns named in the comment line); and bare text with a point a line, which is read as a
//! table ([`super::csv`]).

use super::columns::{ComponentStride, ParticleLayout, StridedColumn};
use super::sniff::{TextShape, text_shape};
use super::text::{self, Lines};
use super::{ByteSource, Step, csv};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit, ValueNames};
use crate::shared::SharedBytes;
use spherule_frame::{Endian, ParseError, RawParticles, ScalarType};

mod comment;
mod foreign;
mod molecular;
mod notes;

/// Raw f32 triples, molecular text, or bare text: the content decides.
pub const FORMAT: Format = Format::new(&Xyz);

struct Xyz;

impl Reader for Xyz {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: true,
            has_no_signature: true,
            ..FormatInfo::new("xyz", &["xyz", "extxyz"])
        }
    }

    /// Raw triples may be any bytes, so the name counts. An empty file has no raw triples.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(match text_shape(head) {
            Some(TextShape::Counted | TextShape::Numbers) => Confidence::Likely,
            _ => Confidence::IfNamed,
        })
    }

    fn stream_unit(&self, head: &[u8]) -> Option<StreamUnit> {
        match kind(head).ok()? {
            XyzVariant::Molecular => Some(StreamUnit::Rows),
            XyzVariant::Bare => csv::stream_unit(head),
            XyzVariant::Raw => None,
        }
    }

    /// One step for each frame of molecular text.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let head = text.head();
        match kind(head)? {
            XyzVariant::Raw => Ok(vec![Step::whole(head.len())]),
            XyzVariant::Molecular => {
                text.go_to(text_start(head));
                molecular::steps(text, budget)
            }
            XyzVariant::Bare => csv::steps(text),
        }
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let head = text.head();
        match kind(head)? {
            XyzVariant::Raw => raw_layout(head)?.particles(head),
            XyzVariant::Molecular => {
                let range = step.byte_range().cloned().unwrap_or_default();
                molecular::read(text, range, budget)
            }
            XyzVariant::Bare => csv::read(text, budget),
        }
    }

    /// `None` for text.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let is_raw = kind(bytes)? == XyzVariant::Raw;
        is_raw.then(|| raw_layout(bytes)).transpose()
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        match kind(head) {
            Ok(XyzVariant::Molecular) => notes::notes(head),
            Ok(XyzVariant::Bare) => csv::notes(head),
            Ok(XyzVariant::Raw) | Err(_) => Vec::new(),
        }
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        let is_molecular = matches!(kind(file), Ok(XyzVariant::Molecular));
        is_molecular.then(|| notes::value_names(file)).flatten().into_iter().collect()
    }
}

/// Which of the formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum XyzVariant {
    /// Little-endian f32 triples without a header.
    Raw,
    /// Frames of a count, a comment, and a line for each atom.
    Molecular,
    /// A point a line.
    Bare,
}

/// Bytes to look at; that many bytes of floats are never all printable.
const WINDOW: usize = 4096;

/// Bytes of a particle in a raw file.
const TRIPLE: usize = 12;

/// A file of so few particles may be raw although all bytes are printable.
const FEW: usize = 4 * TRIPLE;

/// Tells which format `bytes` are. An empty file is raw, with no particles.
///
/// # Errors
/// [`ParseError::Malformed`] if they are none: binary, but no whole number of triples, or text in
/// which neither a count and atoms nor rows of numbers are found.
pub fn kind(bytes: &[u8]) -> Result<XyzVariant, ParseError> {
    if bytes.is_empty() {
        return Ok(XyzVariant::Raw);
    }
    let start = text_start(bytes);
    if let Some(at) = first_binary(bytes) {
        return if bytes.len().is_multiple_of(TRIPLE) {
            Ok(XyzVariant::Raw)
        } else {
            let what = format!(
                "neither raw f32 triples ({} bytes are not a multiple of {TRIPLE}; perhaps still being written) nor text (this byte is {:#04x})",
                bytes.len(),
                bytes.get(at).copied().unwrap_or_default()
            );
            Err(ParseError::malformed(at, what))
        };
    }
    let mut lines = Lines::new(bytes, start..bytes.len());
    let first = lines.next();
    let count = first.and_then(|line| text::integer(line.text.trim_ascii()));
    if let Some(count @ 0..) = count {
        return molecular_kind(count, lines);
    }
    if first_row_has_numbers(bytes, start) || csv::finds_columns(bytes) {
        return Ok(XyzVariant::Bare);
    }
    if bytes.len() <= FEW && bytes.len().is_multiple_of(TRIPLE) {
        return Ok(XyzVariant::Raw);
    }
    let what = format!(
        "text, but {} is neither a particle count nor a row of numbers",
        text::shown(first.map_or(b"", |line| line.text))
    );
    Err(ParseError::malformed(start, what))
}

/// Where the numbers of raw triples are.
///
/// # Errors
/// [`ParseError::Unsupported`] if the first ones cannot be positions.
fn raw_layout(bytes: &[u8]) -> Result<ParticleLayout, ParseError> {
    check_plausible(bytes)?;
    let first = ComponentStride { start: 0, stride: TRIPLE };
    let scalar = (ScalarType::F32, Endian::Little);
    let axes = StridedColumn::interleaved("the positions", scalar, 3, first);
    Ok(ParticleLayout::new(bytes.len() / TRIPLE, vec![axes], Vec::new()))
}

/// Raw numbers that are looked at.
const SAMPLE: usize = 1 << 14;

/// Checks that the first numbers of `bytes` may be raw triples. Integers, double precision, or the other byte order
/// look like coordinates both far smaller and far larger than any simulation has together.
fn check_plausible(bytes: &[u8]) -> Result<(), ParseError> {
    let (numbers, _) = bytes.as_chunks::<4>();
    let sizes = numbers
        .iter()
        .take(SAMPLE)
        .map(|number| f32::from_le_bytes(*number).abs())
        .filter(|size| *size > 0.0 && size.is_finite());
    let (smallest, largest) =
        sizes.fold((f32::INFINITY, 0.0_f32), |(low, high), size| (low.min(size), high.max(size)));
    if smallest > 1e-20 || largest < 1e15 {
        return Ok(());
    }
    let what = format!(
        "not raw f32 triples, the only binary .xyz that is read: as such its coordinates would be between {smallest:e} \
         and {largest:e}; write .vtk, .ply or .npy (of Plot3D grids, with ParaView)"
    );
    Err(ParseError::unsupported(what))
}

/// Offset of the text after a byte order mark.
fn text_start(bytes: &[u8]) -> usize {
    if bytes.starts_with(csv::BYTE_ORDER_MARK) { csv::BYTE_ORDER_MARK.len() } else { 0 }
}

/// Offset of the first byte at the head of the file that text does not have. Comments may be any
/// UTF-8: lines after `#` or `//`, and the second line if the first is a count.
fn first_binary(bytes: &[u8]) -> Option<usize> {
    let start = text_start(bytes);
    let end = bytes.len().min(WINDOW);
    let is_text = |b: &u8| matches!(b, b'\t' | b'\n' | b'\r' | b' '..=b'~');
    let mut counted = false;
    for (number, line) in Lines::new(bytes, start..end).enumerate() {
        if number == 0 {
            counted = text::integer(line.text.trim_ascii()).is_some();
        }
        let is_comment =
            counted && number == 1 || line.text.starts_with(b"#") || line.text.starts_with(b"//");
        if is_comment && is_utf8_text(line.text) {
            continue;
        }
        // The line end is text; a carriage return before it, too.
        if let Some(at) = line.text.iter().position(|b| !is_text(b)) {
            return Some(line.at + at);
        }
    }
    None
}

/// True if `text` is UTF-8, perhaps cut inside its last character, without control characters.
fn is_utf8_text(text: &[u8]) -> bool {
    let whole = match std::str::from_utf8(text) {
        Ok(_) => true,
        Err(error) => error.error_len().is_none(),
    };
    whole && text.iter().all(|b| *b >= b' ' || *b == b'\t')
}

/// With a count in the first line, the third decides; if the file ends before, it is cut short.
fn molecular_kind(count: i64, mut lines: Lines<'_>) -> Result<XyzVariant, ParseError> {
    let comment = lines.next();
    let extended = comment.is_some_and(|line| comment::value(line.text, "Properties").is_some());
    let Some(third) = lines.next() else {
        return Ok(XyzVariant::Molecular);
    };
    let fields = text::words(third.text).take(4).count();
    if count == 0 || extended || fields >= 4 || lines.is_at_end() {
        return Ok(XyzVariant::Molecular);
    }
    let what = format!(
        "after a count and a comment an atom has an element and x y z, not {}",
        text::shown(third.text)
    );
    Err(ParseError::malformed(third.at, what))
}

/// True if the first line that is not a comment has three numbers.
fn first_row_has_numbers(bytes: &[u8], start: usize) -> bool {
    let mut lines = Lines::new(bytes, start..bytes.len());
    let row = lines.find(|line| {
        let text = line.text.trim_ascii();
        !text.is_empty() && !text.starts_with(b"#") && !text.starts_with(b"//")
    });
    let numbers = row.into_iter().flat_map(|line| {
        line.text.split(|b| b" \t,;".contains(b)).filter(|word| text::number(word).is_some())
    });
    numbers.take(3).count() == 3
}

#[cfg(test)]
mod tests;
