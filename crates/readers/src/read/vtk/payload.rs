//! The numbers after a keyword line: what the type names mean and how many bytes they take, in
//! ASCII and in (always big-endian) binary.

use super::ascii::{read_values, skip_words};
use super::cursor::LineCursor;
use super::keywords::is_section_start;
use super::types::{VtkEncoding, VtkType};
use crate::read::columns::{ComponentStride, StridedColumn};
use spherule_frame::{AttributeData, Endian, MemoryBudget, ParseError, ScalarType};

/// `tuples * components`, checked.
pub(super) fn value_count(
    at: usize,
    tuples: usize,
    components: usize,
) -> Result<usize, ParseError> {
    tuples.checked_mul(components).ok_or_else(|| {
        ParseError::malformed(at, format!("{tuples} tuples of {components} are too many"))
    })
}

/// The numbers of an array, in binary files their offset.
pub(super) enum ArrayNumbers {
    /// Of text.
    Decoded(AttributeData),
    /// Big-endian ones.
    Binary {
        /// First byte.
        at: usize,
        scalar: ScalarType,
        count: usize,
    },
    /// Eight to a byte.
    Bits {
        /// First byte.
        at: usize,
        count: usize,
    },
}

impl ArrayNumbers {
    /// Bytes that decoding allocates; none for numbers that are decoded already.
    pub(super) const fn byte_len(&self) -> u64 {
        match *self {
            Self::Decoded(_) => 0,
            Self::Binary { scalar, count, .. } => (count * scalar.size()) as u64,
            Self::Bits { count, .. } => count as u64,
        }
    }

    /// The numbers themselves; `bytes` are the file in which they were found.
    ///
    /// # Errors
    /// Malformed if they are not there.
    pub(super) fn decode(self, bytes: &[u8]) -> Result<AttributeData, ParseError> {
        let stored = |at: usize, len: usize| {
            let rest = bytes.get(at..).and_then(|rest| rest.get(..len));
            rest.ok_or_else(|| ParseError::malformed(at, format!("{len} bytes are missing")))
        };
        match self {
            Self::Decoded(data) => Ok(data),
            Self::Binary { at, scalar, count } => {
                scalar.decode(Endian::Big, stored(at, count * scalar.size())?)
            }
            Self::Bits { at, count } => Ok(unpack_bits(stored(at, count.div_ceil(8))?, count)),
        }
    }

    /// Colours as bytes, which text has as numbers from 0 to 1: what VTK itself makes of them.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to bytes before"
    )]
    pub(super) fn into_color_codes(self) -> Self {
        match self {
            Self::Decoded(AttributeData::F32(values)) => {
                let code = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
                Self::Decoded(AttributeData::U8(values.into_iter().map(code).collect()))
            }
            other => other,
        }
    }

    /// The numbers, `components` a particle, as a column; none for text and bits.
    pub(super) fn column(&self, name: String, components: usize) -> Option<StridedColumn> {
        let Self::Binary { at, scalar, .. } = *self else {
            return None;
        };
        let first = ComponentStride { start: at, stride: components * scalar.size() };
        let scalar = (scalar, Endian::Big);
        Some(StridedColumn::interleaved(name, scalar, components, first))
    }
}

/// Finds `count` numbers at the cursor, and reads them if they are text, within `budget`. `what` names them in errors.
///
/// # Errors
/// Malformed if the file is too short for them or a text is not a number; Unsupported for text; too large.
pub(super) fn take_values(
    cursor: &mut LineCursor<'_, '_>,
    (encoding, budget): (VtkEncoding, MemoryBudget),
    stored: VtkType,
    count: usize,
    what: &str,
) -> Result<ArrayNumbers, ParseError> {
    if encoding == VtkEncoding::Ascii {
        let scalar = match stored {
            VtkType::Scalar(scalar) => scalar,
            VtkType::Either(ScalarType::U64 | ScalarType::U32, _) => ScalarType::U64,
            VtkType::Either(..) => ScalarType::I64,
            VtkType::Bit => ScalarType::U8,
            VtkType::Text => return Err(text_is_no_number(what)),
        };
        let data = read_values(cursor.text(), count, scalar, budget)?;
        return Ok(ArrayNumbers::Decoded(data));
    }
    let at = cursor.at();
    let scalar = match stored {
        VtkType::Scalar(scalar) => scalar,
        VtkType::Either(usual, other) => likelier(cursor, usual, other, count),
        VtkType::Bit => {
            read_bit_bytes(cursor, count, what)?;
            return Ok(ArrayNumbers::Bits { at, count });
        }
        VtkType::Text => return Err(text_is_no_number(what)),
    };
    take_numbers(cursor, scalar, count, what)?;
    Ok(ArrayNumbers::Binary { at, scalar, count })
}

/// Skips `count` values.
///
/// # Errors
/// Malformed if the file is too short for them.
pub(super) fn skip_values(
    cursor: &mut LineCursor<'_, '_>,
    encoding: VtkEncoding,
    stored: VtkType,
    count: usize,
    what: &str,
) -> Result<(), ParseError> {
    if stored == VtkType::Text {
        return skip_texts(cursor, encoding, count, what);
    }
    if encoding == VtkEncoding::Ascii {
        return skip_words(cursor.text(), count);
    }
    let scalar = match stored {
        VtkType::Scalar(scalar) => scalar,
        VtkType::Either(usual, other) => likelier(cursor, usual, other, count),
        VtkType::Bit | VtkType::Text => {
            return read_bit_bytes(cursor, count, what);
        }
    };
    take_numbers(cursor, scalar, count, what)
}

/// The type of the two after whose payload the file goes on sensibly; the usual one in doubt.
fn likelier(
    cursor: &mut LineCursor<'_, '_>,
    usual: ScalarType,
    other: ScalarType,
    count: usize,
) -> ScalarType {
    let mut goes_on = |scalar: ScalarType| {
        cursor.ahead(|ahead| {
            let skipped = count.checked_mul(scalar.size()).and_then(|n| ahead.take(n));
            skipped.is_some()
                && match ahead.keyword_line() {
                    Ok(Some(line)) => is_section_start(&line),
                    Ok(None) => true,
                    Err(_) => false,
                }
        })
    };
    if !goes_on(usual) && goes_on(other) { other } else { usual }
}

fn take_numbers(
    cursor: &mut LineCursor<'_, '_>,
    scalar: ScalarType,
    count: usize,
    what: &str,
) -> Result<(), ParseError> {
    let bytes = count.checked_mul(scalar.size());
    bytes.and_then(|bytes| cursor.take(bytes)).ok_or_else(|| {
        ParseError::malformed(
            cursor.at(),
            format!(
                "{what}: {count} numbers of type {} need {} bytes, {} are left",
                scalar.name(),
                count as u128 * scalar.size() as u128,
                cursor.rest().len()
            ),
        )
    })
}

fn read_bit_bytes(
    cursor: &mut LineCursor<'_, '_>,
    count: usize,
    what: &str,
) -> Result<(), ParseError> {
    let bytes = count.div_ceil(8);
    cursor.take(bytes).ok_or_else(|| {
        ParseError::malformed(
            cursor.at(),
            format!("{what}: {count} bits need {bytes} bytes, {} are left", cursor.rest().len()),
        )
    })
}

/// Bits as bytes of 0 or 1; the first is the highest of its byte.
fn unpack_bits(packed: &[u8], count: usize) -> AttributeData {
    let mut bits = Vec::with_capacity(count);
    for byte in packed {
        bits.extend((0..8).rev().map(|shift| byte >> shift & 1));
    }
    bits.truncate(count);
    AttributeData::U8(bits)
}

/// Strings: a line each, or in binary a length of 1, 2, 4 or 8 bytes (given by the two highest bits)
/// and the text.
fn skip_texts(
    cursor: &mut LineCursor<'_, '_>,
    encoding: VtkEncoding,
    count: usize,
    what: &str,
) -> Result<(), ParseError> {
    for done in 0..count {
        let skipped = match encoding {
            VtkEncoding::Ascii => cursor.line()?.map(|_| ()),
            VtkEncoding::Binary => skip_binary_text(cursor),
        };
        if skipped.is_none() {
            return Err(ParseError::malformed(
                cursor.at(),
                format!("{what}: the file ends after {done} of {count} strings"),
            ));
        }
    }
    Ok(())
}

fn skip_binary_text(cursor: &mut LineCursor<'_, '_>) -> Option<()> {
    let first = *cursor.rest().first()?;
    let width = match first >> 6 {
        3 => 1,
        2 => 2,
        1 => 4,
        _ => 8,
    };
    let mut length = 0_u64;
    for (index, byte) in cursor.rest().get(..width)?.iter().enumerate() {
        let byte = if index == 0 { byte & 0x3f } else { *byte };
        length = length << 8 | u64::from(byte);
    }
    cursor.take(width)?;
    cursor.take(usize::try_from(length).ok()?)
}

fn text_is_no_number(what: &str) -> ParseError {
    ParseError::unsupported(format!("{what} is of type string; write it as numbers"))
}
