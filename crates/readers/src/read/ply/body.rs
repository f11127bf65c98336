//! Finds the binary vertex records after the header: skips the elements before them, and repacks them when
//! they have lists in between, so that every record has the same size.

use std::borrow::Cow;

use super::header::{Element, PlyEncoding, PlyHeader, Property};
use crate::read::columns::check_room;
use spherule_frame::{Endian, ParseError, ScalarType};

/// Vertex records of one size: the scalar properties, packed, in the order of the header.
pub(super) struct VertexRecords<'a> {
    /// What holds them; the file itself if nothing had to be repacked.
    pub(super) bytes: Cow<'a, [u8]>,
    /// First byte of the first record.
    pub(super) start: usize,
    /// Bytes a record.
    pub(super) stride: usize,
}

/// The records of `vertices`, an element of `header`; none in text.
///
/// # Errors
/// [`ParseError::Malformed`] if the file ends early.
pub(super) fn vertex_records<'a>(
    bytes: &'a [u8],
    header: &PlyHeader,
    vertices: &Element,
) -> Result<VertexRecords<'a>, ParseError> {
    let before = header.elements.iter().take_while(|e| !std::ptr::eq(*e, vertices));
    let stride = vertices.scalar_bytes();
    let packed = match header.encoding {
        PlyEncoding::Ascii => Vec::new(),
        PlyEncoding::Binary(endian) => {
            let mut at = header.body;
            for element in before {
                at = skip(bytes, at, element, endian)?;
            }
            check_room(at, vertices.count, vertices.least_bytes(), bytes.len())?;
            if !vertices.has_lists() {
                return Ok(VertexRecords { bytes: Cow::Borrowed(bytes), start: at, stride });
            }
            pack(bytes, at, vertices, endian)?
        }
    };
    Ok(VertexRecords { bytes: Cow::Owned(packed), start: 0, stride })
}

/// The byte after all records of `element`, which begin at `at`.
///
/// # Errors
/// [`ParseError::Malformed`] if the file ends before.
pub(super) fn skip(
    bytes: &[u8],
    mut at: usize,
    element: &Element,
    endian: Endian,
) -> Result<usize, ParseError> {
    let least = element.least_bytes();
    let fits =
        element.count.checked_mul(least).is_some_and(|need| need <= bytes.len().saturating_sub(at));
    if !fits {
        return Err(ParseError::malformed(
            at,
            format!("{} records of element {} do not fit the file", element.count, element.name),
        ));
    }
    if !element.has_lists() {
        return Ok(at + element.count * least);
    }
    for _ in 0..element.count {
        at = walk(bytes, at, element, endian, |_| Ok(()))?;
    }
    Ok(at)
}

/// Copies the scalars of records with lists.
fn pack(
    bytes: &[u8],
    mut at: usize,
    vertices: &Element,
    endian: Endian,
) -> Result<Vec<u8>, ParseError> {
    let mut packed = Vec::with_capacity(vertices.count * vertices.scalar_bytes());
    for _ in 0..vertices.count {
        at = walk(bytes, at, vertices, endian, |values| {
            if values.property.length.is_none() {
                packed.extend_from_slice(values.bytes);
            }
            Ok(())
        })?;
    }
    Ok(packed)
}

/// The number of one property of a record, or the numbers of a list.
pub(super) struct PropertyValues<'a> {
    pub(super) property: &'a Property,
    /// First byte of the numbers.
    pub(super) at: usize,
    pub(super) bytes: &'a [u8],
}

/// Goes through one record, showing each property, and returns the byte after it.
///
/// # Errors
/// Those of `show`; [`ParseError::Malformed`] if the file ends within the record.
pub(super) fn walk<'a>(
    bytes: &'a [u8],
    mut at: usize,
    element: &'a Element,
    endian: Endian,
    mut show: impl FnMut(PropertyValues<'a>) -> Result<(), ParseError>,
) -> Result<usize, ParseError> {
    let take = |at: usize, len: usize| {
        let found = bytes.get(at..).and_then(|rest| rest.get(..len));
        let what = || format!("file ends within element {}", element.name);
        found.ok_or_else(|| ParseError::malformed(at, what()))
    };
    for property in &element.properties {
        let stored = property.length.unwrap_or(property.scalar);
        let number = take(at, stored.size())?;
        let mut values = PropertyValues { property, at, bytes: number };
        if property.length.is_some() {
            let items = unsigned(number, stored, endian).ok_or_else(|| {
                let what = format!("list {} has a negative or absurd length", property.name);
                ParseError::malformed(at, what)
            })?;
            values.at += number.len();
            values.bytes = take(values.at, items.saturating_mul(property.scalar.size()))?;
        }
        at = values.at + values.bytes.len();
        show(values)?;
    }
    Ok(at)
}

/// Reads an item count or an index, without allocating as `ScalarType::decode` would.
pub(super) fn unsigned(number: &[u8], stored: ScalarType, endian: Endian) -> Option<usize> {
    let mut wide = [0; 8];
    let used = wide.get_mut(..number.len())?;
    used.copy_from_slice(number);
    if endian == Endian::Big {
        used.reverse();
    }
    let signed =
        matches!(stored, ScalarType::I8 | ScalarType::I16 | ScalarType::I32 | ScalarType::I64);
    let negative = used.last().is_some_and(|top| *top >= 0x80);
    if signed && negative {
        return None;
    }
    usize::try_from(u64::from_le_bytes(wide)).ok()
}
