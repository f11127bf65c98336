//! The faces of a PLY file. Its vertices are read as those of a point cloud.

use super::header::{Element, PlyEncoding, PlyHeader, Property};
use super::{ascii, body, records_layout, vertices_layout};
use crate::mesh::builder::{Mesh, MeshBuilder};
use crate::read::input::TextInput;
use crate::read::text::{integer, words};
use spherule_frame::{Endian, MemoryBudget, ParseError, Positions, ScalarType};

/// Reads the mesh in `bytes`: the element `vertex`, and the polygons of the element `face`.
///
/// # Errors
/// [`ParseError::Malformed`] if the file is damaged, [`ParseError::Unsupported`] if it has no faces,
/// [`ParseError::TooLarge`].
pub fn read_mesh(bytes: &[u8], budget: MemoryBudget) -> Result<Mesh, ParseError> {
    let header = PlyHeader::parse(bytes)?;
    let Some(vertices) = header.element("vertex") else {
        return Err(ParseError::unsupported("ply without a vertex element"));
    };
    if header.element("face").is_none_or(|faces| faces.count == 0)
        && header.element("tristrips").is_some_and(|strips| strips.count > 0)
    {
        return Err(ParseError::unsupported(
            "a ply of triangle strips (tristrips), which are not read; export faces",
        ));
    }
    let mut builder = MeshBuilder::new(budget);
    match header.encoding {
        PlyEncoding::Ascii => {
            let places = text_places(bytes, &header)?;
            builder.add_vertices(text_positions(bytes, &header, vertices, budget)?)?;
            for (faces, at) in faces(&header, &places) {
                add_text_faces(&mut builder, bytes, faces, at)?;
            }
        }
        PlyEncoding::Binary(endian) => {
            let places = binary_places(bytes, &header, endian)?;
            let need = vertices.count as u64 * vertices.scalar_bytes() as u64;
            builder.check(need)?;
            builder.add_vertices(binary_positions(bytes, &header, vertices)?)?;
            for (faces, at) in faces(&header, &places) {
                add_binary_faces(&mut builder, bytes, (faces, at), endian)?;
            }
        }
    }
    builder.finish()
}

/// The elements that are faces, and where they begin.
fn faces<'h>(
    header: &'h PlyHeader,
    places: &[usize],
) -> impl Iterator<Item = (&'h Element, usize)> {
    let elements = header.elements.iter().zip(places);
    let faces = elements.filter(|(element, _)| element.name == "face" && element.count > 0);
    faces.map(|(element, at)| (element, *at))
}

/// Where each element begins.
fn text_places(bytes: &[u8], header: &PlyHeader) -> Result<Vec<usize>, ParseError> {
    let mut text = TextInput::whole(bytes);
    text.go_to(header.body);
    let place = |element| {
        let at = text.at();
        ascii::skip(&mut text, element)?;
        Ok(at)
    };
    header.elements.iter().map(place).collect()
}

/// As [`text_places`].
fn binary_places(
    bytes: &[u8],
    header: &PlyHeader,
    endian: Endian,
) -> Result<Vec<usize>, ParseError> {
    let mut next = header.body;
    let place = |element| {
        let at = next;
        next = body::skip(bytes, at, element, endian)?;
        Ok(at)
    };
    header.elements.iter().map(place).collect()
}

fn text_positions(
    bytes: &[u8],
    header: &PlyHeader,
    vertices: &Element,
    budget: MemoryBudget,
) -> Result<Positions, ParseError> {
    let mut layout = vertices_layout(header, vertices, 0, vertices.scalar_bytes())?;
    layout.attributes.clear();
    let mut text = TextInput::whole(bytes);
    Ok(ascii::read(&mut text, header, vertices, layout, budget)?.positions)
}

fn binary_positions(
    bytes: &[u8],
    header: &PlyHeader,
    vertices: &Element,
) -> Result<Positions, ParseError> {
    let records = body::vertex_records(bytes, header, vertices)?;
    let mut layout = records_layout(header, vertices, &records)?;
    layout.attributes.clear();
    Ok(layout.particles(&records.bytes)?.positions)
}

/// Whether `property` has the corners of a face. Both names are common.
fn has_corners(property: &Property) -> bool {
    let is_named = ["vertex_indices", "vertex_index"].contains(&property.name.as_str());
    let is_float = matches!(property.scalar, ScalarType::F32 | ScalarType::F64);
    is_named && property.length.is_some() && !is_float
}

/// Checks that `faces` have corners.
fn check_corners(faces: &Element) -> Result<(), ParseError> {
    if faces.properties.iter().any(has_corners) {
        return Ok(());
    }
    Err(ParseError::unsupported(
        "ply faces without a list of integers vertex_indices or vertex_index",
    ))
}

/// Adds the faces in the lines from byte `start` on.
fn add_text_faces(
    builder: &mut MeshBuilder,
    bytes: &[u8],
    faces: &Element,
    start: usize,
) -> Result<(), ParseError> {
    check_corners(faces)?;
    let all = builder.corners();
    let mut text = TextInput::whole(bytes);
    text.go_to(start);
    for _ in 0..faces.count {
        let (at, line) = ascii::next_line(&mut text, faces)?;
        let mut words = words(line);
        for property in &faces.properties {
            let mut next = || {
                let word = words.next();
                word.ok_or_else(|| ascii::too_short(at, property, faces))
            };
            let first = next()?;
            if property.length.is_none() {
                continue;
            }
            let items = integer(first)
                .and_then(|items| usize::try_from(items).ok())
                .ok_or_else(|| ascii::bad_word(at, first, property))?;
            if has_corners(property) {
                let index = |word| integer(word).and_then(|index| u64::try_from(index).ok());
                builder.add_polygon((0..items).map(|_| all.vertex(at, index(next()?))))?;
            } else {
                (0..items).try_for_each(|_| next().map(|_| ()))?;
            }
        }
        if words.next().is_some() {
            return Err(ascii::too_long(at, faces));
        }
    }
    Ok(())
}

/// Adds the faces in the records from byte `at` on.
fn add_binary_faces(
    builder: &mut MeshBuilder,
    bytes: &[u8],
    (faces, mut at): (&Element, usize),
    endian: Endian,
) -> Result<(), ParseError> {
    check_corners(faces)?;
    let all = builder.corners();
    for _ in 0..faces.count {
        at = body::walk(bytes, at, faces, endian, |values| {
            if !has_corners(values.property) {
                return Ok(());
            }
            let scalar = values.property.scalar;
            let numbers = values.bytes.chunks_exact(scalar.size());
            builder.add_polygon(numbers.map(|number| {
                let index = body::unsigned(number, scalar, endian);
                all.vertex(values.at, index.map(|index| index as u64))
            }))
        })?;
    }
    Ok(())
}
