//! The XML part of the file: which arrays there are, of what type, and where their bytes are. What
//! the bytes contain is left to [`super::blocks`].
//!
//! Raw appended data makes the file invalid XML (it holds `<`, `&` and NUL), so the file is cut
//! before `<AppendedData` and only the part in front meets the XML parser.

use std::borrow::Cow;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::blocks::{ArrayEncoding, HeaderType};
use super::compressor::Compressor;
use super::short;
use super::sniff::GIVE_LIST;
use spherule_frame::{Endian, MemoryBudget, ParseError};

/// The parsed XML.
#[derive(Debug)]
pub(super) struct XmlDocument<'a> {
    pub(super) encoding: ArrayEncoding,
    /// Arrays of the dataset as a whole: the time.
    pub(super) fields: Vec<DataArray<'a>>,
    pub(super) pieces: Vec<Piece<'a>>,
}

/// One part of the particles.
#[derive(Debug)]
pub(super) struct Piece<'a> {
    pub(super) points: usize,
    pub(super) coordinates: Option<DataArray<'a>>,
    pub(super) point_data: Vec<DataArray<'a>>,
    /// Cells of each [`CellSection`], if a mesh is read.
    pub(super) cell_counts: [usize; 3],
    /// If a mesh is read.
    pub(super) cells: Vec<CellGroup<'a>>,
}

/// `<Polys>`, `<Strips>` or `<Cells>` of a piece.
#[derive(Debug)]
pub(super) struct CellGroup<'a> {
    /// Byte where its tag ends.
    pub(super) at: usize,
    pub(super) section: CellSection,
    pub(super) arrays: Vec<DataArray<'a>>,
}

/// What the cells of a group are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CellSection {
    Polygons,
    Strips,
    /// Of several types, which an array has.
    Typed,
}

impl CellSection {
    const ALL: [Self; 3] = [Self::Polygons, Self::Strips, Self::Typed];

    /// The element that holds such cells.
    pub(super) const fn element(self) -> &'static str {
        match self {
            Self::Polygons => "Polys",
            Self::Strips => "Strips",
            Self::Typed => "Cells",
        }
    }

    /// The attribute of a piece with the number of such cells.
    const fn count_attribute(self) -> &'static str {
        match self {
            Self::Polygons => "NumberOfPolys",
            Self::Strips => "NumberOfStrips",
            Self::Typed => "NumberOfCells",
        }
    }
}

/// One `<DataArray>`.
#[derive(Debug)]
pub(super) struct DataArray<'a> {
    /// Byte where its tag ends.
    pub(super) at: usize,
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) components: Option<usize>,
    pub(super) tuples: Option<usize>,
    pub(super) place: ArrayLocation<'a>,
}

/// Where the numbers of an array are stored.
#[derive(Debug)]
pub(super) enum ArrayLocation<'a> {
    /// As text inside the element.
    Ascii(ElementText<'a>),
    /// As base64 inside the element.
    Inline(ElementText<'a>),
    /// In the appended data, at this offset from the underscore.
    Appended(usize),
}

/// Text of an element, without that of its children.
#[derive(Debug, Default)]
pub(super) struct ElementText<'a> {
    pub(super) at: usize,
    pub(super) text: Cow<'a, str>,
}

/// Elements that matter; what an element means depends on its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum XmlElement {
    Root,
    Dataset,
    Piece,
    Points,
    PointData,
    CellGroup,
    FieldData,
    DataArray,
    Other,
}

/// What to parse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum XmlPart {
    /// What is before the first piece.
    Fields,
    /// Points and point data.
    Particles,
    /// Points and cells.
    Mesh,
}

impl<'a> XmlDocument<'a> {
    /// Parses `head`, the XML in front of the appended data. `is_cut` is true if appended data
    /// follow, so that open elements at the end are right.
    pub(super) fn parse(head: &'a str, is_cut: bool, part: XmlPart) -> Result<Self, ParseError> {
        let mut parser = XmlParser { document: None, path: Vec::new(), part };
        let mut reader = Reader::from_str(head);
        let mut is_closed = false;
        loop {
            let event = reader.read_event();
            let at = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
            match event {
                Ok(Event::Start(start)) => {
                    let tag = parser.open(&start, at)?;
                    if tag == XmlElement::Piece && part == XmlPart::Fields {
                        break;
                    }
                    parser.path.push(tag);
                }
                Ok(Event::Empty(start)) => {
                    parser.open(&start, at)?;
                }
                Ok(Event::End(_)) => {
                    is_closed |= parser.path.pop() == Some(XmlElement::Root);
                }
                Ok(Event::Text(text)) => parser.text(text.into_inner(), at),
                Ok(Event::CData(text)) => parser.text(text.into_inner(), at),
                Ok(Event::Eof) if is_cut || is_closed => break,
                Ok(Event::Eof) => {
                    return Err(ParseError::malformed(
                        head.len(),
                        "the file ends before </VTKFile>; it may still be being written",
                    ));
                }
                Ok(_) => {}
                Err(error) => return Err(bad_xml(at, &error)),
            }
        }
        parser.document.ok_or_else(|| ParseError::malformed(0, "no <VTKFile> element"))
    }
}

struct XmlParser<'a> {
    document: Option<XmlDocument<'a>>,
    path: Vec<XmlElement>,
    part: XmlPart,
}

impl<'a> XmlParser<'a> {
    /// Records the start of an element and returns its kind.
    fn open(&mut self, start: &BytesStart<'_>, at: usize) -> Result<XmlElement, ParseError> {
        let name = start.local_name();
        let name: &str = name.as_ref();
        let Some(document) = &mut self.document else {
            if name != "VTKFile" {
                return Err(ParseError::malformed(
                    at,
                    format!("the root element is <{}>, not <VTKFile>", short(name)),
                ));
            }
            self.document = Some(XmlDocument {
                encoding: root(start, at)?,
                fields: Vec::new(),
                pieces: Vec::new(),
            });
            return Ok(XmlElement::Root);
        };
        let parent = self.path.last().copied();
        let tag = match (parent, name) {
            (Some(XmlElement::Root | XmlElement::Dataset | XmlElement::Piece), "FieldData") => {
                XmlElement::FieldData
            }
            (Some(XmlElement::Root), _) => XmlElement::Dataset,
            (Some(XmlElement::Dataset), "Piece") => XmlElement::Piece,
            (Some(XmlElement::Piece), "Points") => XmlElement::Points,
            (Some(XmlElement::Piece), "PointData") if self.part != XmlPart::Mesh => {
                XmlElement::PointData
            }
            (Some(XmlElement::Piece), name) if cell_section(self.part, name).is_some() => {
                XmlElement::CellGroup
            }
            (
                Some(
                    XmlElement::Points
                    | XmlElement::PointData
                    | XmlElement::CellGroup
                    | XmlElement::FieldData,
                ),
                "DataArray" | "Array",
            ) => XmlElement::DataArray,
            _ => XmlElement::Other,
        };
        if tag == XmlElement::Piece {
            let mut piece = Piece {
                points: required_count(start, at, "NumberOfPoints")?,
                coordinates: None,
                point_data: Vec::new(),
                cell_counts: [0; 3],
                cells: Vec::new(),
            };
            if self.part == XmlPart::Mesh {
                for section in CellSection::ALL {
                    let count = optional_count(start, at, section.count_attribute())?;
                    piece.cell_counts[section as usize] = count.unwrap_or(0);
                }
            }
            document.pieces.push(piece);
        }
        if tag == XmlElement::CellGroup
            && let (Some(section), Some(piece)) =
                (cell_section(self.part, name), document.pieces.last_mut())
        {
            piece.cells.push(CellGroup { at, section, arrays: Vec::new() });
        }
        if tag == XmlElement::DataArray {
            let array = array(start, at)?;
            match (parent, document.pieces.last_mut()) {
                (Some(XmlElement::FieldData), _) => document.fields.push(array),
                (Some(XmlElement::PointData), Some(piece)) => piece.point_data.push(array),
                (Some(XmlElement::CellGroup), Some(piece)) => {
                    if let Some(group) = piece.cells.last_mut() {
                        group.arrays.push(array);
                    }
                }
                // The first array is the points, whatever its name.
                (Some(XmlElement::Points), Some(piece)) if piece.coordinates.is_none() => {
                    piece.coordinates = Some(array);
                }
                _ => return Ok(XmlElement::Other),
            }
        }
        Ok(tag)
    }

    /// Adds text to the array that is open, if it is the innermost element.
    fn text(&mut self, text: Cow<'a, str>, end: usize) {
        let mut path = self.path.iter().rev();
        if path.next() != Some(&XmlElement::DataArray) || text.trim_ascii().is_empty() {
            return;
        }
        let Some(document) = &mut self.document else {
            return;
        };
        let array = match (path.next(), document.pieces.last_mut()) {
            (Some(XmlElement::FieldData), _) => document.fields.last_mut(),
            (Some(XmlElement::PointData), Some(piece)) => piece.point_data.last_mut(),
            (Some(XmlElement::CellGroup), Some(piece)) => {
                let group = piece.cells.last_mut();
                group.and_then(|group| group.arrays.last_mut())
            }
            (Some(XmlElement::Points), Some(piece)) => piece.coordinates.as_mut(),
            _ => None,
        };
        let Some(ArrayLocation::Ascii(place) | ArrayLocation::Inline(place)) =
            array.map(|a| &mut a.place)
        else {
            return;
        };
        if place.text.is_empty() {
            place.at = end.saturating_sub(text.len());
            place.text = text;
        } else {
            let joined = place.text.to_mut();
            joined.push(' ');
            joined.push_str(&text);
        }
    }
}

/// The cells in the element `name` of a piece; `None` for points, lines and anything else, and unless a mesh is read.
fn cell_section(part: XmlPart, name: &str) -> Option<CellSection> {
    let mut sections = CellSection::ALL.into_iter();
    sections.find(|section| part == XmlPart::Mesh && section.element() == name)
}

/// Checks the root element and reads how arrays are encoded.
fn root(start: &BytesStart<'_>, at: usize) -> Result<ArrayEncoding, ParseError> {
    let kind = attribute(start, at, "type")?.unwrap_or_default();
    match kind.as_str() {
        "UnstructuredGrid" | "PolyData" => {}
        "PUnstructuredGrid"
        | "PPolyData"
        | "Collection"
        | "vtkMultiBlockDataSet"
        | "vtkPartitionedDataSet"
        | "vtkPartitionedDataSetCollection"
        | "vtkHierarchicalBoxDataSet" => {
            let what = format!("{kind} lists other files: {GIVE_LIST}");
            return Err(ParseError::unsupported(what));
        }
        _ => {
            return Err(ParseError::unsupported(format!(
                "VTKFile of type `{}` is not read; write UnstructuredGrid (.vtu) or PolyData (.vtp)",
                short(&kind)
            )));
        }
    }
    let endian = match attribute(start, at, "byte_order")?.as_deref() {
        Some("BigEndian") => Endian::Big,
        _ => Endian::Little,
    };
    let header = match attribute(start, at, "header_type")?.as_deref() {
        None | Some("UInt32" | "") => HeaderType::U32,
        Some("UInt64") => HeaderType::U64,
        Some(other) => {
            return Err(ParseError::malformed(
                at,
                format!("header_type `{}` is not UInt32 or UInt64", short(other)),
            ));
        }
    };
    let compressor = match attribute(start, at, "compressor")?.as_deref() {
        None | Some("") => None,
        Some(name) => Some(Compressor::from_name(name)?),
    };
    Ok(ArrayEncoding { endian, header, compressor, decoders: MemoryBudget::UNLIMITED })
}

fn array<'a>(start: &BytesStart<'_>, at: usize) -> Result<DataArray<'a>, ParseError> {
    let format = attribute(start, at, "format")?.unwrap_or_default();
    let place = match format.to_ascii_lowercase().as_str() {
        "ascii" | "" => ArrayLocation::Ascii(ElementText::default()),
        "binary" => ArrayLocation::Inline(ElementText::default()),
        "appended" => ArrayLocation::Appended(required_count(start, at, "offset")?),
        _ => {
            return Err(ParseError::malformed(
                at,
                format!("format `{}` is not ascii, binary or appended", short(&format)),
            ));
        }
    };
    Ok(DataArray {
        at,
        name: attribute(start, at, "Name")?.unwrap_or_default(),
        type_name: attribute(start, at, "type")?.unwrap_or_default(),
        components: optional_count(start, at, "NumberOfComponents")?,
        tuples: optional_count(start, at, "NumberOfTuples")?,
        place,
    })
}

/// The value of the attribute `name`, without white space around it.
///
/// # Errors
/// [`ParseError`] at byte `at` if the attributes or the value are not XML.
pub fn attribute(
    start: &BytesStart<'_>,
    at: usize,
    name: &str,
) -> Result<Option<String>, ParseError> {
    let found = start.try_get_attribute(name);
    let Some(found) = found.map_err(|error| bad_xml(at, &error))? else {
        return Ok(None);
    };
    let value = found.normalized_value(XmlVersion::Implicit1_0);
    value.map(|v| Some(v.trim().to_owned())).map_err(|error| bad_xml(at, &error))
}

fn optional_count(
    start: &BytesStart<'_>,
    at: usize,
    name: &str,
) -> Result<Option<usize>, ParseError> {
    match attribute(start, at, name)? {
        None => Ok(None),
        Some(value) if value.is_empty() => Ok(None),
        Some(value) => value.parse().map(Some).map_err(|_| {
            ParseError::malformed(at, format!("{name}=\"{}\" is not a count", short(&value)))
        }),
    }
}

fn required_count(start: &BytesStart<'_>, at: usize, name: &str) -> Result<usize, ParseError> {
    optional_count(start, at, name)?
        .ok_or_else(|| ParseError::malformed(at, format!("an element without {name}")))
}

fn bad_xml(at: usize, error: &dyn std::fmt::Display) -> ParseError {
    ParseError::malformed(at, format!("bad XML: {error}"))
}
