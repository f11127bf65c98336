//! The mesh in a legacy file: POLYGONS and TRIANGLE_STRIPS of POLYDATA, CELLS of UNSTRUCTURED_GRID.

use super::no_points;
use super::payload::ArrayNumbers;
use super::positions::positions;
use super::walk::{CellSection, Cells, WalkEnd, Walker};
use crate::mesh::builder::{Mesh, MeshBuilder};
use crate::mesh::cells::{CellArray, CellExtents, CellKind};
use crate::read::input::TextInput;
use spherule_frame::{AttributeData, MemoryBudget, ParseError};

/// Reads the mesh in `bytes`.
///
/// # Errors
/// [`ParseError::Malformed`] if the file is damaged, [`ParseError::Unsupported`] if it has no faces,
/// [`ParseError::TooLarge`].
pub fn read_mesh(bytes: &[u8], budget: MemoryBudget) -> Result<Mesh, ParseError> {
    let mut text = TextInput::whole(bytes);
    let mut walker = Walker::begin(&mut text, budget)?.for_mesh();
    walker.walk(WalkEnd::End)?;
    let points = walker.points.ok_or_else(|| no_points(bytes.len()))?;
    let cells = walker.mesh.unwrap_or_default();
    // Without the numbers that were text.
    let mut builder = MeshBuilder::new(walker.budget);
    builder.check(points.numbers.byte_len())?;
    builder.add_vertices(positions(points.numbers.decode(bytes)?))?;
    let types = cells.types.map(|types| types.decode(bytes)).transpose()?;
    for section in cells.sections {
        add(&mut builder, bytes, section, types.as_ref())?;
    }
    builder.finish()
}

/// Adds the cells of a section.
fn add(
    builder: &mut MeshBuilder,
    bytes: &[u8],
    section: Cells,
    types: Option<&AttributeData>,
) -> Result<(), ParseError> {
    let at = section.at;
    let held = section.connectivity.byte_len()
        + section.offsets.as_ref().map_or(0, ArrayNumbers::byte_len);
    builder.check(held)?;
    builder.hold(held);
    let (count, extents) = match section.offsets {
        // An empty list of offsets is that of no cells.
        Some(_) if section.count == 0 => return Ok(()),
        Some(offsets) => (section.count - 1, CellExtents::Starts(offsets.decode(bytes)?)),
        None => (section.count, CellExtents::Counts),
    };
    let cells = CellArray { at, count, connectivity: section.connectivity.decode(bytes)?, extents };
    let kind = match (section.section, types) {
        (CellSection::Polygons, _) => CellKind::Polygons,
        (CellSection::Strips, _) => CellKind::Strips,
        (CellSection::Typed, Some(types)) => CellKind::Types(types),
        (CellSection::Typed, None) if count == 0 => return Ok(()),
        (CellSection::Typed, None) => {
            return Err(ParseError::malformed(at, "CELLS without CELL_TYPES"));
        }
    };
    cells.add_to(builder, &kind)?;
    builder.release(held);
    Ok(())
}
