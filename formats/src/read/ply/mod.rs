//! PLY point clouds: ascii and binary of both byte orders, any order of properties.
//!
//! `header` reads the text on top, `body` finds (or repacks) the vertex records, and the shared
//! column reader decodes them. Meshes are refused: their vertices are a surface, not particles.
//! Follows Greg Turk's 1994 description and what Blender, Open3D and `CloudCompare` write beyond it.

mod ascii;
mod body;
mod header;
#[cfg(test)]
mod tests;

use self::body::Records;
use self::header::{Element, Encoding, Header};
use super::Step;
use super::columns::{self, Column, Lane, ParticleLayout};
use super::input::TextInput;
use crate::{Endian, MemoryBudget, ParseError, RawParticles};

/// The time steps that `text` holds: one.
///
/// # Errors
/// [`ParseError::Malformed`] for a broken header, [`ParseError::Unsupported`] for a mesh or a file
/// without vertices.
pub(crate) fn steps(text: &TextInput<'_>) -> Result<Vec<Step>, ParseError> {
    let header = Header::parse(text.head())?;
    vertices(&header)?;
    Ok(vec![Step::whole(text.left_about())])
}

/// Reads the vertices with all their scalar properties as attributes.
///
/// `vx vy vz` become `velocity`, `nx ny nz` `normal`, `red green blue [alpha]` `color`; a leading
/// `scalar_` is dropped from names; list properties are skipped. Positions are f64 if a coordinate is
/// `double` (or a 32-bit integer), else f32.
///
/// # Errors
/// As [`steps`]; [`ParseError::Malformed`] if the data does not match the header, [`ParseError::TooLarge`] beyond
/// `budget`.
pub(crate) fn read(
    text: &mut TextInput<'_>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let bytes = text.head();
    let header = Header::parse(bytes)?;
    let vertices = vertices(&header)?;
    if header.encoding == Encoding::Ascii {
        let layout = vertices_layout(&header, vertices, 0, vertices.scalar_bytes())?;
        return ascii::read(text, &header, vertices, layout, budget);
    }
    let records = body::vertex_records(bytes, &header, vertices)?;
    records_layout(&header, vertices, &records)?.particles(&records.bytes)
}

/// True if `head`, the beginning of a file, is all of its header, and text follows.
pub(crate) fn is_text(head: &[u8]) -> bool {
    Header::parse(head).is_ok_and(|header| header.encoding == Encoding::Ascii)
}

/// Where the vertices are; none if they are text, or have lists between their numbers.
///
/// # Errors
/// As [`read`].
pub(crate) fn layout(bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
    let header = Header::parse(bytes)?;
    let vertices = vertices(&header)?;
    if header.encoding == Encoding::Ascii || vertices.has_lists() {
        return Ok(None);
    }
    let records = body::vertex_records(bytes, &header, vertices)?;
    records_layout(&header, vertices, &records).map(Some)
}

fn records_layout(
    header: &Header,
    vertices: &Element,
    records: &Records<'_>,
) -> Result<ParticleLayout, ParseError> {
    vertices_layout(header, vertices, records.start, records.stride)
}

/// For records of `stride` bytes from byte `start` on.
fn vertices_layout(
    header: &Header,
    vertices: &Element,
    start: usize,
    stride: usize,
) -> Result<ParticleLayout, ParseError> {
    let endian = match header.encoding {
        Encoding::Ascii => Endian::Little,
        Encoding::Binary(endian) => endian,
    };
    let mut properties = vertex_columns(vertices, (start, stride), endian);
    let mut axes = Vec::with_capacity(3);
    for axis in ["x", "y", "z"] {
        let Some(index) = properties.iter().position(|c| is_named(c, axis)) else {
            return Err(ParseError::unsupported(format!(
                "ply vertices have no property {axis}: export points with x, y and z"
            )));
        };
        axes.push(properties.remove(index));
    }
    let attributes = columns::group_vectors(properties);
    Ok(ParticleLayout::new(vertices.count, axes, attributes))
}

fn is_named(column: &Column, name: &str) -> bool {
    column.name.eq_ignore_ascii_case(name)
}

/// The element that holds the particles.
fn vertices(header: &Header) -> Result<&Element, ParseError> {
    let faces = ["face", "tristrips"]
        .iter()
        .find_map(|name| header.element(name).filter(|e| e.count > 0));
    if let Some(faces) = faces {
        return Err(ParseError::unsupported(format!(
            "a mesh with {} faces, not particles: export points only",
            faces.count
        )));
    }
    header.element("vertex").ok_or_else(|| {
        let names: Vec<&str> = header.elements.iter().map(|e| e.name.as_str()).collect();
        ParseError::unsupported(format!(
            "ply without a vertex element, it has [{}]: export points as vertices",
            names.join(", ")
        ))
    })
}

/// One column for each scalar property, in the order of the header.
fn vertex_columns(
    vertices: &Element,
    (start, stride): (usize, usize),
    endian: Endian,
) -> Vec<Column> {
    let mut offset = start;
    let mut columns = Vec::with_capacity(vertices.properties.len());
    for property in vertices.properties.iter().filter(|p| p.length.is_none()) {
        let name = property.name.strip_prefix("scalar_");
        columns.push(Column {
            name: name.unwrap_or(&property.name).to_owned(),
            scalar: property.scalar,
            endian,
            lanes: vec![Lane {
                start: offset,
                stride,
            }],
        });
        offset += property.scalar.size();
    }
    columns
}
