//! The layout of geometry: counts, attributes of points, types of primitives.
//!
//! The file is a list of names and values. Attributes are pairs of a definition and values, by what they belong to.
//! Values of strings are indices into a table, as in classic files. After `hgeo.py`, which comes with Houdini, and the
//! open readers `bgeo_reader` of Laika and `houio`.

use super::cursor::JsonCursor;
use super::paged::{StoredValues, count};
use super::tokens::{Token, Value, unexpected};
use spherule_frame::{MemoryBudget, ParseError};

/// Most types of primitives that are listed.
const MAX_TYPES: usize = 64;

/// What a file says of its points.
#[derive(Debug, Default)]
pub(super) struct Geometry<'a> {
    /// Version of Houdini.
    pub(super) version: Option<String>,
    pub(super) point_count: Option<usize>,
    pub(super) attributes: Vec<PointAttribute<'a>>,
    /// Types of primitives, each once, without the `_run` of those that are stored together.
    pub(super) primitive_types: Vec<String>,
    /// Attributes of types that are not read.
    pub(super) unread: Vec<String>,
    /// Bytes of numbers in memory.
    numbers_len: u64,
}

/// An attribute of points.
#[derive(Debug)]
pub(super) struct PointAttribute<'a> {
    pub(super) name: String,
    pub(super) values: StoredValues<'a>,
}

impl<'a> Geometry<'a> {
    /// Reads `bytes` into `self`, up to the first fault.
    ///
    /// # Errors
    /// [`ParseError`].
    pub(super) fn read(&mut self, bytes: &'a [u8], budget: MemoryBudget) -> Result<(), ParseError> {
        let mut cursor = JsonCursor::new(bytes, budget)?;
        let root = cursor.next()?;
        cursor.pairs(root, |cursor, name, value| match name {
            b"fileversion" => {
                if let Value::Text(version) = value.value {
                    self.version = Some(String::from_utf8_lossy(version).into_owned());
                }
                cursor.skip(value)
            }
            b"pointcount" => {
                self.point_count = Some(count(value)?);
                Ok(())
            }
            b"attributes" => cursor.pairs(value, |cursor, owner, attributes| {
                if owner != b"pointattributes" {
                    return cursor.skip(attributes);
                }
                cursor.elements(attributes, |cursor, _, attribute| {
                    self.read_attribute(cursor, attribute, budget)
                })
            }),
            b"primitives" => cursor
                .elements(value, |cursor, _, primitive| self.read_primitive(cursor, primitive)),
            _ => cursor.skip(value),
        })
    }

    /// Reads the definition and the values of an attribute.
    fn read_attribute(
        &mut self,
        cursor: &mut JsonCursor<'a>,
        attribute: Token<'a>,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        let (mut name, mut kind, mut scope) = (None, &b""[..], &b"public"[..]);
        let mut values = None;
        cursor.elements(attribute, |cursor, index, part| match index {
            0 => cursor.pairs(part, |cursor, key, value| {
                match (key, value.value) {
                    (b"name", Value::Text(text)) => name = Some(text),
                    (b"type", Value::Text(text)) => kind = text,
                    (b"scope", Value::Text(text)) => scope = text,
                    _ => cursor.skip(value)?,
                }
                Ok(())
            }),
            1 => {
                let wanted = match kind {
                    b"numeric" => &b"values"[..],
                    b"string" => b"indices",
                    _ => return cursor.skip(part),
                };
                cursor.pairs(part, |cursor, key, value| {
                    if key != wanted {
                        return cursor.skip(value);
                    }
                    let stored = StoredValues::read(cursor, value, budget.less(self.numbers_len))?;
                    self.numbers_len += stored.numbers_len();
                    values = Some(stored);
                    Ok(())
                })
            }
            _ => cursor.skip(part),
        })?;
        // Others are Houdini's own
        if scope != b"public" {
            return Ok(());
        }
        let name = name.ok_or_else(|| unexpected(attribute.at, "the name of an attribute"))?;
        let name = String::from_utf8_lossy(name).into_owned();
        let need =
            size_of::<PointAttribute<'_>>() * (self.attributes.len() + self.unread.len() + 1);
        budget.check(need as u64, "the list of its attributes is")?;
        match values {
            Some(values) => self.attributes.push(PointAttribute { name, values }),
            None if matches!(kind, b"numeric" | b"string") => {
                let what = format!("attribute `{name}` has no values");
                return Err(ParseError::malformed(attribute.at, what));
            }
            None => self.unread.push(name),
        }
        Ok(())
    }

    /// Notes the type of a primitive, or of a run of primitives.
    fn read_primitive(
        &mut self,
        cursor: &mut JsonCursor<'a>,
        primitive: Token<'a>,
    ) -> Result<(), ParseError> {
        let (mut kind, mut run_kind) = (None, None);
        cursor.elements(primitive, |cursor, index, part| {
            if index > 0 {
                return cursor.skip(part);
            }
            cursor.pairs(part, |cursor, key, value| {
                match (key, value.value) {
                    (b"type", Value::Text(text)) => kind = Some(text),
                    (b"runtype", Value::Text(text)) => run_kind = Some(text),
                    _ => cursor.skip(value)?,
                }
                Ok(())
            })
        })?;
        if let Some(kind) = run_kind.or(kind) {
            let kind = String::from_utf8_lossy(kind.strip_suffix(b"_run").unwrap_or(kind));
            let is_new = !self.primitive_types.iter().any(|known| *known == kind);
            if is_new && self.primitive_types.len() < MAX_TYPES {
                self.primitive_types.push(kind.into_owned());
            }
        }
        Ok(())
    }

    /// The first type of primitives that have geometry of their own inside.
    pub(super) fn packed_type(&self) -> Option<&str> {
        let mut types = self.primitive_types.iter().map(String::as_str);
        types.find(|kind| kind.starts_with("Packed") || kind.starts_with("Alembic"))
    }
}
