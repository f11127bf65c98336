//! What an item of an array is made of: `descr` of the header, flattened to fields with offsets.

use super::literal::Literal;
use spherule_frame::{Endian, ParseError, ScalarType};

/// More numbers in one item than any particle has; wider fields are left out. It also bounds what a
/// header of an empty array can claim.
pub(super) const MAX_COMPONENTS: usize = 64;

/// Type and byte order of a number that can be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NumberType {
    pub(super) scalar: ScalarType,
    pub(super) endian: Endian,
}

/// One named part of an item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct RecordField {
    /// Name, with the names of enclosing structures before it (`outer.inner`).
    pub(super) name: String,
    /// Byte within the item.
    pub(super) offset: usize,
    /// How it is stored.
    pub(super) number: NumberType,
    /// Numbers in it, at most [`MAX_COMPONENTS`].
    pub(super) components: usize,
}

/// The type of an item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Dtype {
    /// One number.
    Plain(NumberType),
    /// A structure; strings, padding, complex numbers and the like are left out of the list.
    Record(Vec<RecordField>),
    /// Something that is not a number, by its code (`|S8`, `<f2`).
    Opaque(String),
    /// Python objects somewhere in it.
    Pickled,
}

/// A type and its size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ItemType {
    pub(super) dtype: Dtype,
    /// Bytes an item; 0 for pickled objects.
    pub(super) size: usize,
}

/// Reads the value of `descr`. `at` is the offset to blame.
///
/// # Errors
/// [`ParseError::Malformed`] if it is not a dtype or its size overflows.
pub(super) fn parse(descr: &Literal, at: usize) -> Result<ItemType, ParseError> {
    match descr {
        Literal::Text(code) => parse_code(code, at),
        Literal::Sequence(fields) => {
            let mut record = RecordBuilder { at, fields: Vec::new(), size: 0, pickled: false };
            for field in fields {
                record.add(field)?;
            }
            let dtype = if record.pickled { Dtype::Pickled } else { Dtype::Record(record.fields) };
            Ok(ItemType { dtype, size: record.size })
        }
        _ => Err(ParseError::malformed(at, "npy header: descr is not a dtype")),
    }
}

/// A plain type code: byte order, kind, size.
fn parse_code(code: &str, at: usize) -> Result<ItemType, ParseError> {
    let bad = || ParseError::malformed(at, format!("npy header: `{code}` is not a dtype"));
    let order = code.chars().next().ok_or_else(bad)?;
    let endian = match order {
        '>' => Endian::Big,
        _ => Endian::Little,
    };
    let rest = code.strip_prefix(['<', '>', '|', '=']).unwrap_or(code);
    let mut chars = rest.chars();
    let kind = chars.next().ok_or_else(bad)?;
    if kind == 'O' {
        return Ok(ItemType { dtype: Dtype::Pickled, size: 0 });
    }
    // A unit may follow, as in `<M8[ns]`.
    let digits = chars.as_str().split('[').next().unwrap_or_default();
    let size: usize = digits.parse().map_err(|_| bad())?;
    let scalar = match (kind, size) {
        ('f', 4) => Some(ScalarType::F32),
        ('f', 8) => Some(ScalarType::F64),
        ('i', 1) => Some(ScalarType::I8),
        ('i', 2) => Some(ScalarType::I16),
        ('i', 4) => Some(ScalarType::I32),
        ('i', 8) => Some(ScalarType::I64),
        ('u' | 'b', 1) => Some(ScalarType::U8),
        ('u', 2) => Some(ScalarType::U16),
        ('u', 4) => Some(ScalarType::U32),
        ('u', 8) => Some(ScalarType::U64),
        ('f' | 'c' | 'S' | 'a' | 'U' | 'V' | 'M' | 'm', _) => None,
        _ => return Err(bad()),
    };
    let dtype = match scalar {
        Some(scalar) => Dtype::Plain(NumberType { scalar, endian }),
        None => Dtype::Opaque(code.to_owned()),
    };
    // Unicode strings are counted in characters of 4 bytes.
    let width = if kind == 'U' { 4 } else { 1 };
    let size = size.checked_mul(width).ok_or_else(bad)?;
    Ok(ItemType { dtype, size })
}

/// Lays fields one after another; numpy writes padding as unnamed void fields.
struct RecordBuilder {
    at: usize,
    fields: Vec<RecordField>,
    size: usize,
    pickled: bool,
}

impl RecordBuilder {
    fn bad(&self, what: &str) -> ParseError {
        ParseError::malformed(self.at, format!("npy header: {what}"))
    }

    /// Adds `(name, descr)` or `(name, descr, shape)`.
    fn add(&mut self, field: &Literal) -> Result<(), ParseError> {
        let Literal::Sequence(parts) = field else {
            return Err(self.bad("a field of descr is not a tuple"));
        };
        let (name, descr, shape) = match parts.as_slice() {
            [name, descr] => (name, descr, None),
            [name, descr, shape] => (name, descr, Some(shape)),
            _ => return Err(self.bad("a field of descr has neither 2 nor 3 parts")),
        };
        let name = field_name(name).ok_or_else(|| self.bad("a field of descr has no name"))?;
        let count = match shape {
            None => Some(1),
            Some(shape) => {
                let shape = dimensions(shape).ok_or_else(|| self.bad("bad shape of a field"))?;
                shape.iter().try_fold(1, |n: usize, d| n.checked_mul(*d))
            }
        };
        let item = parse(descr, self.at)?;
        let offset = self.size;
        let end = count
            .and_then(|count| count.checked_mul(item.size))
            .and_then(|bytes| offset.checked_add(bytes));
        let (Some(components), Some(end)) = (count, end) else {
            return Err(self.bad("the size of a field overflows"));
        };
        self.size = end;
        match item.dtype {
            Dtype::Pickled => self.pickled = true,
            Dtype::Plain(number) if (1..=MAX_COMPONENTS).contains(&components) => {
                self.fields.push(RecordField { name: name.to_owned(), offset, number, components });
            }
            Dtype::Record(inner) if components == 1 => {
                self.fields.extend(inner.into_iter().map(|field| RecordField {
                    name: format!("{name}.{}", field.name),
                    offset: offset + field.offset,
                    ..field
                }));
            }
            Dtype::Plain(_) | Dtype::Record(_) | Dtype::Opaque(_) => {}
        }
        Ok(())
    }
}

/// A field with a title has the pair (title, name) for a name.
fn field_name(value: &Literal) -> Option<&str> {
    match value {
        Literal::Text(name) => Some(name),
        Literal::Sequence(pair) => match pair.as_slice() {
            [Literal::Text(_), Literal::Text(name)] => Some(name),
            _ => None,
        },
        _ => None,
    }
}

/// A shape: a tuple of sizes, or one size.
pub(super) fn dimensions(value: &Literal) -> Option<Vec<usize>> {
    let dimension = |value: &Literal| match value {
        Literal::Integer(n) => usize::try_from(*n).ok(),
        _ => None,
    };
    match value {
        Literal::Sequence(sizes) => sizes.iter().map(dimension).collect(),
        Literal::Integer(_) => dimension(value).map(|d| vec![d]),
        _ => None,
    }
}
