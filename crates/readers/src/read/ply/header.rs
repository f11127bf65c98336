//! The text header of a PLY file: elements, their properties, and where the data begins.

use spherule_frame::{Endian, ParseError, ScalarType};

/// How the data after the header is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlyEncoding {
    /// One line of text an element.
    Ascii,
    /// Packed numbers.
    Binary(Endian),
}

/// One property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    /// Type of the number, or of the items of a list.
    pub(super) scalar: ScalarType,
    /// Type of the item count; `None` unless it is a list.
    pub(super) length: Option<ScalarType>,
}

/// A kind of record and how many of it there are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary record without its lists.
    pub(super) fn scalar_bytes(&self) -> usize {
        let scalars = self.properties.iter().filter(|p| p.length.is_none());
        scalars.map(|p| p.scalar.size()).sum()
    }

    /// Bytes of the shortest binary record: all lists empty.
    pub(super) fn least_bytes(&self) -> usize {
        let stored = self.properties.iter().map(|p| p.length.unwrap_or(p.scalar));
        stored.map(ScalarType::size).sum()
    }

    pub(super) fn has_lists(&self) -> bool {
        self.properties.iter().any(|p| p.length.is_some())
    }
}

/// A parsed header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PlyHeader {
    pub(super) encoding: PlyEncoding,
    /// In the order of their data.
    pub(super) elements: Vec<Element>,
    /// First byte of the data.
    pub(super) body: usize,
}

impl PlyHeader {
    /// Reads up to and including the line `end_header`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the offending line.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let mut lines = HeaderLines::new(bytes)?;
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let (at, line) = lines.next()?;
            let text = String::from_utf8_lossy(line);
            let mut words = text.split_ascii_whitespace();
            match words.next() {
                None | Some("comment" | "obj_info") => {}
                Some("format") => encoding = Some(parse_format(at, words.next())?),
                Some("element") => elements.push(parse_element(at, words)?),
                Some("property") => elements
                    .last_mut()
                    .ok_or_else(|| ParseError::malformed(at, "property before any element"))?
                    .properties
                    .push(parse_property(at, words)?),
                Some("end_header") => break,
                Some(word) => {
                    return Err(ParseError::malformed(
                        at,
                        format!("ply header line begins with `{}`", shorten(word)),
                    ));
                }
            }
        }
        let encoding =
            encoding.ok_or_else(|| ParseError::malformed(0, "ply header without a format line"))?;
        Ok(Self { encoding, elements, body: lines.at })
    }

    /// The first element called `name`.
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }
}

/// Header lines with their offsets. The data may begin with any byte, so a line ends at exactly one
/// line feed (the carriage return before it is part of the line), or at one carriage return in files
/// whose first line ends so.
struct HeaderLines<'a> {
    bytes: &'a [u8],
    at: usize,
    end_of_line: u8,
}

impl<'a> HeaderLines<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let is_space = |b: &u8| b.is_ascii_whitespace();
        let rest = bytes.strip_prefix(b"ply");
        let Some(rest) = rest.filter(|rest| rest.first().is_none_or(is_space)) else {
            return Err(ParseError::malformed(0, "no ply file: the first line is not `ply`"));
        };
        let old_mac = rest.first() == Some(&b'\r') && rest.get(1) != Some(&b'\n');
        let mut lines = Self { bytes, at: 0, end_of_line: if old_mac { b'\r' } else { b'\n' } };
        lines.next()?;
        Ok(lines)
    }

    fn next(&mut self) -> Result<(usize, &'a [u8]), ParseError> {
        let start = self.at;
        let rest = self.bytes.get(start..).unwrap_or_default();
        let Some(len) = rest.iter().position(|b| *b == self.end_of_line) else {
            return Err(ParseError::malformed(
                start,
                "file ends before end_header of the ply header",
            ));
        };
        self.at = start + len + 1;
        Ok((start, rest.get(..len).unwrap_or_default()))
    }
}

fn parse_format(at: usize, word: Option<&str>) -> Result<PlyEncoding, ParseError> {
    match word {
        Some("ascii") => Ok(PlyEncoding::Ascii),
        Some("binary_little_endian") => Ok(PlyEncoding::Binary(Endian::Little)),
        Some("binary_big_endian") => Ok(PlyEncoding::Binary(Endian::Big)),
        other => Err(ParseError::malformed(
            at,
            format!("unknown ply format `{}`", shorten(other.unwrap_or(""))),
        )),
    }
}

fn parse_element<'w>(
    at: usize,
    mut words: impl Iterator<Item = &'w str>,
) -> Result<Element, ParseError> {
    let (Some(name), Some(count)) = (words.next(), words.next()) else {
        return Err(ParseError::malformed(at, "element without name and count"));
    };
    let count = count.parse().map_err(|_| {
        ParseError::malformed(
            at,
            format!("the number of {} is `{}`", shorten(name), shorten(count)),
        )
    })?;
    Ok(Element { name: name.to_owned(), count, properties: Vec::new() })
}

fn parse_property<'w>(
    at: usize,
    mut words: impl Iterator<Item = &'w str>,
) -> Result<Property, ParseError> {
    let mut next =
        || words.next().ok_or_else(|| ParseError::malformed(at, "property without type and name"));
    let first = next()?;
    let (length, scalar) = if first == "list" {
        let length = scalar_type(at, next()?)?;
        if matches!(length, ScalarType::F32 | ScalarType::F64) {
            return Err(ParseError::malformed(at, "a list is counted in floating point"));
        }
        (Some(length), scalar_type(at, next()?)?)
    } else {
        (None, scalar_type(at, first)?)
    };
    Ok(Property { name: next()?.to_owned(), scalar, length })
}

/// Both sets of type names; 64-bit integers are an extension that some writers use.
fn scalar_type(at: usize, word: &str) -> Result<ScalarType, ParseError> {
    Ok(match word {
        "char" | "int8" => ScalarType::I8,
        "uchar" | "uint8" => ScalarType::U8,
        "short" | "int16" => ScalarType::I16,
        "ushort" | "uint16" => ScalarType::U16,
        "int" | "int32" => ScalarType::I32,
        "uint" | "uint32" => ScalarType::U32,
        "int64" => ScalarType::I64,
        "uint64" => ScalarType::U64,
        "float" | "float32" => ScalarType::F32,
        "double" | "float64" => ScalarType::F64,
        _ => {
            return Err(ParseError::malformed(at, format!("unknown ply type `{}`", shorten(word))));
        }
    })
}

/// Words of a damaged file can be long; a message should not be.
pub(super) fn shorten(word: &str) -> String {
    word.chars().take(40).collect()
}
