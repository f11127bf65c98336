//! The preamble of an NPY array, versions 1 to 3: magic, length, and a dictionary with type, order
//! and shape.

use super::dtype::{self, Dtype, ItemType};
use super::literal::{self, Literal};
use crate::read::text::same_length;
use spherule_frame::ParseError;

/// First bytes of every NPY file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// Bytes that are enough to know how long the header is.
pub(super) const PREAMBLE: usize = 12;
/// numpy itself stops at 10000 characters by default.
const MAX_HEADER: usize = 1 << 20;

/// A parsed header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NpyHeader {
    /// Type and size of an item.
    pub(super) item: ItemType,
    /// The first index varies fastest.
    pub(super) fortran: bool,
    /// Sizes of the dimensions; empty for a scalar.
    pub(super) shape: Vec<usize>,
    /// First byte of the items.
    pub(super) data: usize,
    /// Bytes of all items.
    pub(super) bytes: usize,
}

/// Bytes from the start of the file to the first item, from the first [`PREAMBLE`] bytes.
///
/// # Errors
/// [`ParseError::Malformed`] if this is no NPY file or the length is absurd;
/// [`ParseError::Unsupported`] for versions after 3.
pub(super) fn length(bytes: &[u8]) -> Result<usize, ParseError> {
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        return Err(ParseError::malformed(0, "not an npy file: it does not begin with \\x93NUMPY"));
    };
    let (start, text) = match rest {
        [1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([*a, *b]))),
        [2 | 3, _, a, b, c, d, ..] => {
            let text = u32::from_le_bytes([*a, *b, *c, *d]);
            (PREAMBLE, usize::try_from(text).unwrap_or(usize::MAX))
        }
        [] | [1..=3, ..] => {
            return Err(ParseError::malformed(6, "file ends within the npy header"));
        }
        [version, ..] => {
            return Err(ParseError::unsupported(format!(
                "npy version {version}, versions 1 to 3 are read: save with numpy.save"
            )));
        }
    };
    if text > MAX_HEADER {
        return Err(ParseError::malformed(
            8,
            format!("npy header of {text} bytes; at most {MAX_HEADER} are allowed"),
        ));
    }
    Ok(start + text)
}

impl NpyHeader {
    /// Parses the header at the start of `bytes`, which must hold all of it; the items need not be
    /// there, see [`Self::check_items`].
    ///
    /// # Errors
    /// [`ParseError::Malformed`] or [`ParseError::Unsupported`].
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let data = length(bytes)?;
        let major = bytes.get(6).copied().unwrap_or(1);
        let start = if major == 1 { 10 } else { PREAMBLE };
        let text = bytes
            .get(start..data)
            .ok_or_else(|| ParseError::malformed(bytes.len(), "file ends within the npy header"))?;
        // Before version 3 the text is latin-1, whose bytes are the first code points.
        let (text, bytes_of): (_, fn(&str) -> usize) = if major == 3 {
            (same_length(text), str::len)
        } else {
            let text: String = text.iter().copied().map(char::from).collect();
            (text.into(), |text| text.chars().count())
        };
        let Literal::Dict(entries) = literal::parse(&text, |before| start + bytes_of(before))?
        else {
            return Err(ParseError::malformed(start, "npy header is not a dictionary"));
        };
        let entry = |name: &str| {
            let named = |(key, _): &&(Literal, Literal)| *key == Literal::Text(name.to_owned());
            entries.iter().find(named).map(|(_, value)| value)
        };
        let bad = |what: &str| ParseError::malformed(start, format!("npy header: {what}"));
        let item = dtype::parse(entry("descr").ok_or_else(|| bad("no descr"))?, start)?;
        let fortran = match entry("fortran_order") {
            Some(Literal::Bool(fortran)) => *fortran,
            _ => return Err(bad("no fortran_order")),
        };
        let shape = entry("shape").and_then(dtype::dimensions);
        let shape = shape.ok_or_else(|| bad("no shape of non-negative sizes"))?;
        let bytes = array_bytes(&shape, item.size)
            .ok_or_else(|| bad(&format!("an array of shape {} overflows", show(&shape))))?;
        Ok(Self { item, fortran, shape, data, bytes })
    }

    /// Refuses an array whose items do not fit a file of `len` bytes.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] with the bytes needed and the bytes there.
    pub(super) fn check_items(&self, len: usize) -> Result<(), ParseError> {
        let available = len.saturating_sub(self.data);
        if self.bytes <= available {
            return Ok(());
        }
        Err(ParseError::malformed(
            self.data,
            format!(
                "an array of shape {} needs {} bytes, file has {available} left",
                show(&self.shape),
                self.bytes
            ),
        ))
    }

    /// Whether reading it would need a pickle interpreter.
    pub(super) fn is_pickled(&self) -> bool {
        self.item.dtype == Dtype::Pickled
    }

    /// Bytes between neighbours along each dimension.
    pub(super) fn strides(&self) -> Vec<usize> {
        let mut strides = vec![0; self.shape.len()];
        let mut step = self.item.size;
        let mut lay = |(stride, size): (&mut usize, &usize)| {
            *stride = step;
            // Only sizes next to a zero can overflow; such an array has no items.
            step = step.saturating_mul(*size);
        };
        let pairs = strides.iter_mut().zip(&self.shape);
        if self.fortran {
            pairs.for_each(&mut lay);
        } else {
            pairs.rev().for_each(&mut lay);
        }
        strides
    }
}

/// Bytes of all items. Dimensions of 0 count as 1 in the check for overflow, so that no partial
/// product can overflow either.
fn array_bytes(shape: &[usize], item: usize) -> Option<usize> {
    let most =
        shape.iter().try_fold(item, |bytes: usize, size| bytes.checked_mul((*size).max(1)))?;
    Some(if shape.contains(&0) { 0 } else { most })
}

/// A shape as Python writes it.
pub(super) fn show(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}
