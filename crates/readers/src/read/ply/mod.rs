//! PLY point clouds: ascii and binary of both byte orders, any order of properties.
//!
//! `header` reads the text on top, `body` finds (or repacks) the vertex records, and the shared
//! column reader decodes them. Meshes are refused unless their vertices are asked for: these are a surface, not particles.
//! `mesh` reads those.
//! Follows Greg Turk's 1994 description and what Blender, Open3D and `CloudCompare` write beyond it.

mod ascii;
mod body;
mod header;
mod mesh;
#[cfg(test)]
mod tests;

pub use self::mesh::read_mesh;

use self::body::VertexRecords;
use self::header::{Element, PlyEncoding, PlyHeader};
use super::columns::{self, ComponentStride, ParticleLayout, StridedColumn};
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{Endian, ParseError, RawParticles};

/// PLY, text or binary.
pub const FORMAT: Format = Format::new(&Ply);

struct Ply;

impl Reader for Ply {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("ply", &["ply"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_ply = head.starts_with(b"ply\n") || head.starts_with(b"ply\r");
        Ok(Confidence::signature_if(is_ply))
    }

    /// Words, if `head` is all of the header, and text follows.
    fn stream_unit(&self, head: &[u8]) -> Option<StreamUnit> {
        let header = PlyHeader::parse(head).ok()?;
        (header.encoding == PlyEncoding::Ascii).then_some(StreamUnit::Words)
    }

    /// [`ParseError::Malformed`] for a broken header, [`ParseError::Unsupported`] for a file without vertices.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let text = source.text();
        let header = PlyHeader::parse(text.head())?;
        vertices(&header)?;
        Ok(vec![Step::whole(text.left_about())])
    }

    /// Reads the vertices with all their scalar properties as attributes.
    ///
    /// `vx vy vz` become `velocity`, `nx ny nz` `normal`, `red green blue [alpha]` `color`; a leading
    /// `scalar_` is dropped from names; list properties are skipped. Positions are f64 if a coordinate is
    /// `double` (or a 32-bit integer), else f32.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let (budget, has_mesh_points) = (source.budget(), source.has_mesh_points());
        let text = source.text();
        let bytes = text.head();
        let header = PlyHeader::parse(bytes)?;
        if !has_mesh_points {
            refuse_mesh(&header)?;
        }
        let vertices = vertices(&header)?;
        let mut particles = if header.encoding == PlyEncoding::Ascii {
            let layout = vertices_layout(&header, vertices, 0, vertices.scalar_bytes())?;
            ascii::read(text, &header, vertices, layout, budget)?
        } else {
            let records = body::vertex_records(bytes, &header, vertices)?;
            records_layout(&header, vertices, &records)?.particles(&records.bytes)?
        };
        let faces = faces_text(&header).map(|(faces, _)| faces);
        let note = |faces| format!("a mesh with {faces}: its vertices are read as particles");
        particles.notes.extend(faces.map(note));
        Ok(particles)
    }

    /// `None` if the vertices are text, or have lists between their numbers.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let header = PlyHeader::parse(bytes)?;
        refuse_mesh(&header)?;
        let vertices = vertices(&header)?;
        if header.encoding == PlyEncoding::Ascii || vertices.has_lists() {
            return Ok(None);
        }
        let records = body::vertex_records(bytes, &header, vertices)?;
        records_layout(&header, vertices, &records).map(Some)
    }
}

fn records_layout(
    header: &PlyHeader,
    vertices: &Element,
    records: &VertexRecords<'_>,
) -> Result<ParticleLayout, ParseError> {
    vertices_layout(header, vertices, records.start, records.stride)
}

/// For records of `stride` bytes from byte `start` on.
fn vertices_layout(
    header: &PlyHeader,
    vertices: &Element,
    start: usize,
    stride: usize,
) -> Result<ParticleLayout, ParseError> {
    let endian = match header.encoding {
        PlyEncoding::Ascii => Endian::Little,
        PlyEncoding::Binary(endian) => endian,
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

fn is_named(column: &StridedColumn, name: &str) -> bool {
    column.name.eq_ignore_ascii_case(name)
}

/// What a mesh consists of, and how else it is drawn; `None` for points. Strips are counted as one, and are not drawn.
fn faces_text(header: &PlyHeader) -> Option<(String, &'static str)> {
    let mut names = ["face", "tristrips"].iter();
    let faces = names.find_map(|name| header.element(name).filter(|e| e.count > 0))?;
    Some(match faces.name.as_str() {
        "face" => (format!("{} faces", faces.count), "draw it with --mesh, or "),
        _ => ("triangle strips".to_owned(), ""),
    })
}

/// [`ParseError::Unsupported`] for a mesh.
fn refuse_mesh(header: &PlyHeader) -> Result<(), ParseError> {
    let Some((faces, remedy)) = faces_text(header) else {
        return Ok(());
    };
    Err(ParseError::unsupported(format!(
        "a mesh with {faces}, not particles: {remedy}read its vertices as particles with --mesh-points \
         (input.mesh_points = true)"
    )))
}

/// The element that holds the particles.
fn vertices(header: &PlyHeader) -> Result<&Element, ParseError> {
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
) -> Vec<StridedColumn> {
    let mut offset = start;
    let mut columns = Vec::with_capacity(vertices.properties.len());
    for property in vertices.properties.iter().filter(|p| p.length.is_none()) {
        let name = property.name.strip_prefix("scalar_");
        let first = ComponentStride { start: offset, stride };
        let name = name.unwrap_or(&property.name);
        let column = StridedColumn::interleaved(name, (property.scalar, endian), 1, first);
        columns.push(column);
        offset += property.scalar.size();
    }
    columns
}
