//! BGEO version 5, Houdini's "classic" binary geometry, as partio writes it for most SPH codes.
//!
//! Big-endian throughout: a header of 41 bytes, attribute definitions, then one record a point.
//! Reading stops after the points; groups, primitives and detail attributes carry no particles, and
//! writers disagree about them. Newer Houdini containers share the extension only and are refused by
//! name. Gzip around the file is undone by the caller. Layout after partio's `BGEO.cpp`.

use super::columns::{self, ComponentStride, ParticleLayout, StridedColumn};
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{Endian, ParseError, RawParticles, ScalarType};

#[cfg(test)]
mod tests;

/// The first bytes of the file, before the version.
const MAGIC: &[u8] = b"BgeoV";
/// Bytes before the attribute definitions.
const HEADER: usize = 41;
/// The only version with this layout that writers still produce.
const VERSION: i32 = 5;
/// x, y, z and w, before the attributes of a record.
const POSITION_BYTES: usize = 16;
/// Widest attribute listed for a file without points.
const MAX_EMPTY_COMPONENTS: usize = 16;

/// Classic BGEO version 5.
pub const FORMAT: Format = Format::new(&Bgeo);

struct Bgeo;

impl Reader for Bgeo {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("bgeo", &["bgeo", "bhclassic"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(head.starts_with(MAGIC)))
    }

    /// [`ParseError::Unsupported`] for other geometry files, [`ParseError::Malformed`] for
    /// anything else that is not classic BGEO.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        check_kind(source.bytes())?;
        Ok(vec![Step::whole(source.bytes().len())])
    }

    /// Reads all points with all their attributes, under the names of the file.
    ///
    /// Floats and vectors become f32, integers and indices of indexed strings i32. Positions are divided
    /// by their homogeneous coordinate unless it is 0 or 1.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let bytes = source.bytes();
        point_layout(bytes)?.particles(bytes)
    }

    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        point_layout(bytes).map(Some)
    }

    /// Houdini's axes.
    fn is_y_up(&self, _head: &[u8]) -> bool {
        true
    }
}

/// Where the points are.
///
/// # Errors
/// [`ParseError::Malformed`] if the definitions or points do not fit the file, [`ParseError::Unsupported`] for other
/// geometry files and for point attributes of type string.
fn point_layout(bytes: &[u8]) -> Result<ParticleLayout, ParseError> {
    check_kind(bytes)?;
    let mut cursor = HeaderCursor { bytes, at: 9 };
    let count = cursor.count("points")?;
    cursor.at = 25;
    let definition_count = cursor.count("point attributes")?;
    cursor.at = HEADER;
    cursor.take(0, "the header")?;
    let mut definitions = Vec::new();
    for _ in 0..definition_count {
        definitions.push(cursor.definition()?);
    }
    let mut stride = POSITION_BYTES;
    for definition in &definitions {
        // At most 65535 components in each, and each took bytes of the file: no overflow.
        stride += definition.components * 4;
    }
    let start = cursor.at;
    if count == 0 {
        // Without points nothing bounds the width that a corrupt definition may claim.
        definitions.retain(|d| d.components <= MAX_EMPTY_COMPONENTS);
    }
    columns::check_room(start, count, stride, bytes.len())?;
    let axes = vec![column("P", ScalarType::F32, 3, start, stride)];
    let attributes = attribute_columns(definitions, start, stride);
    let weight = column("w of P", ScalarType::F32, 1, start + 12, stride);
    Ok(ParticleLayout { weight: Some(weight), ..ParticleLayout::new(count, axes, attributes) })
}

/// Tells classic BGEO of version 5 from its relatives.
fn check_kind(bytes: &[u8]) -> Result<(), ParseError> {
    const CLASSIC: &str = "save as classic bgeo (.bhclassic) from houdini";
    let relatives: [(&[u8], &str); 5] = [
        (b"\x7fNSJ", "houdini's binary json geometry, not bgeo version 5"),
        (b"scf1", "blosc-compressed geometry (.bgeo.sc)"),
        (b"PGEOMETRY", "the text form of classic geometry (.geo)"),
        (b"[", "houdini's text json geometry (.geo), not bgeo version 5"),
        (b"bgeo", "an older houdini geometry file"),
    ];
    for (magic, what) in relatives {
        if bytes.starts_with(magic) {
            return Err(ParseError::unsupported(format!("{what}: {CLASSIC}")));
        }
    }
    if !bytes.starts_with(MAGIC) {
        return Err(ParseError::malformed(0, "not a bgeo file: it does not begin with BgeoV"));
    }
    let mut cursor = HeaderCursor { bytes, at: 5 };
    match cursor.i32("the version")? {
        VERSION => Ok(()),
        other => Err(ParseError::unsupported(format!(
            "bgeo version {other}, only version {VERSION} is read: {CLASSIC}"
        ))),
    }
}

/// One point attribute of the header.
struct AttributeDefinition {
    name: String,
    components: usize,
    scalar: ScalarType,
}

fn column(
    name: impl Into<String>,
    scalar: ScalarType,
    components: usize,
    start: usize,
    stride: usize,
) -> StridedColumn {
    let first = ComponentStride { start, stride };
    StridedColumn::interleaved(name, (scalar, Endian::Big), components, first)
}

/// The attributes in the order of the file.
fn attribute_columns(
    definitions: Vec<AttributeDefinition>,
    start: usize,
    stride: usize,
) -> Vec<StridedColumn> {
    let mut at = start + POSITION_BYTES;
    let mut columns = Vec::with_capacity(definitions.len());
    for AttributeDefinition { name, components, scalar } in definitions {
        columns.push(column(name, scalar, components, at, stride));
        at += 4 * components;
    }
    columns
}

/// Walks the header; every step is checked against the end of the file.
struct HeaderCursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl HeaderCursor<'_> {
    fn take(&mut self, len: usize, what: &str) -> Result<&[u8], ParseError> {
        let end = self.at.checked_add(len);
        let taken = end.and_then(|end| self.bytes.get(self.at..end));
        let Some(taken) = taken else {
            // The cursor jumps to fixed offsets, which a short file does not have.
            return Err(ParseError::malformed(
                self.at.min(self.bytes.len()),
                format!("file ends within {what}"),
            ));
        };
        self.at += len;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], ParseError> {
        let taken = self.take(N, what)?;
        Ok(*taken.first_chunk().expect("take gave N bytes"))
    }

    fn i32(&mut self, what: &str) -> Result<i32, ParseError> {
        self.array(what).map(i32::from_be_bytes)
    }

    fn u16(&mut self, what: &str) -> Result<usize, ParseError> {
        self.array(what).map(u16::from_be_bytes).map(usize::from)
    }

    fn count(&mut self, what: &str) -> Result<usize, ParseError> {
        let at = self.at;
        let count = self.i32(what)?;
        usize::try_from(count)
            .map_err(|_| ParseError::malformed(at, format!("the number of {what} is {count}")))
    }

    fn definition(&mut self) -> Result<AttributeDefinition, ParseError> {
        const WHAT: &str = "a point attribute definition";
        let name_len = self.u16(WHAT)?;
        let name = String::from_utf8_lossy(self.take(name_len, WHAT)?).into_owned();
        let components = self.u16(WHAT)?;
        let at = self.at;
        let kind = self.i32(WHAT)?;
        let scalar = match kind {
            0 | 5 => ScalarType::F32,
            1 | 4 => ScalarType::I32,
            2 => {
                return Err(ParseError::unsupported(format!(
                    "point attribute `{name}` is of type string: delete it or make it an indexed \
                     string before saving"
                )));
            }
            _ => {
                return Err(ParseError::malformed(
                    at,
                    format!("point attribute `{name}` has the unknown type {kind}"),
                ));
            }
        };
        if kind == 4 {
            self.skip_strings()?;
        } else {
            self.take(4 * components, "the default values of a point attribute")?;
        }
        Ok(AttributeDefinition { name, components, scalar })
    }

    /// The table of an indexed string; points hold indices into it.
    fn skip_strings(&mut self) -> Result<(), ParseError> {
        const WHAT: &str = "the strings of a point attribute";
        for _ in 0..self.count(WHAT)? {
            let len = self.u16(WHAT)?;
            self.take(len, WHAT)?;
        }
        Ok(())
    }
}
