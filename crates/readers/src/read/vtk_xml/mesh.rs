//! The mesh in an XML file: `<Polys>` and `<Strips>` of PolyData, `<Cells>` of UnstructuredGrid.

use super::appended::Appended;
use super::document::{CellGroup, CellSection, Piece, XmlDocument, XmlPart};
use super::merge::{filled, not_numeric, piece_positions};
use super::{check_memory, check_shares, most_bytes, parse, scalar_type, values};
use crate::mesh::builder::{Mesh, MeshBuilder};
use crate::mesh::cells::{CellArray, CellExtents, CellKind, unsigned};
use spherule_frame::{AttributeData, MemoryBudget, ParseError};

/// Reads the mesh in `bytes`, all pieces.
///
/// # Errors
/// [`ParseError::Malformed`] if the file is damaged, [`ParseError::Unsupported`] if it has no faces or is a kind of
/// file that is not read, [`ParseError::TooLarge`].
pub fn read_mesh(bytes: &[u8], budget: MemoryBudget) -> Result<Mesh, ParseError> {
    parse(bytes, XmlPart::Mesh, |mut document, appended| {
        check_shares(&document, appended)?;
        document.encoding.decoders = check_memory(&document, budget)?;
        let mut builder = MeshBuilder::new(budget);
        for piece in filled(&document) {
            builder.add_vertices(piece_positions(&document, piece, appended)?)?;
            let groups = CellReader {
                document: &document,
                piece,
                appended,
                most_numbers: most_bytes(&document, bytes.len()),
            };
            for group in &piece.cells {
                groups.add(&mut builder, group)?;
            }
        }
        builder.finish()
    })
}

/// Reads the cells of a piece.
struct CellReader<'d, 'a> {
    document: &'d XmlDocument<'a>,
    piece: &'d Piece<'a>,
    appended: Option<Appended<'d>>,
    /// More numbers than any file of this length can hold: each has a byte at least.
    most_numbers: usize,
}

impl CellReader<'_, '_> {
    /// Adds the cells of `group` to `builder`, whose last vertices are those of the piece.
    fn add(&self, builder: &mut MeshBuilder, group: &CellGroup<'_>) -> Result<(), ParseError> {
        let count = self.piece.cell_counts[group.section as usize];
        let Some(last) = count.checked_sub(1) else {
            return Ok(());
        };
        // They count to the end: many arrays that share few compressed bytes could take long otherwise.
        let mut array = |name: &str, count: usize| {
            let data = self.array(builder, group, name, count)?;
            builder.hold(data.byte_len());
            Ok::<AttributeData, ParseError>(data)
        };
        let ends = array("offsets", count)?;
        let indices =
            unsigned(&ends, last).and_then(|end| usize::try_from(end).ok()).ok_or_else(|| {
                ParseError::malformed(group.at, "the last of the offsets of cells is negative")
            })?;
        let connectivity = array("connectivity", indices)?;
        let types = match group.section {
            CellSection::Typed => Some(array("types", count)?),
            CellSection::Polygons | CellSection::Strips => None,
        };
        let kind = match (group.section, &types) {
            (CellSection::Strips, _) => CellKind::Strips,
            (_, Some(types)) => CellKind::Types(types),
            (_, None) => CellKind::Polygons,
        };
        let cells =
            CellArray { at: group.at, count, connectivity, extents: CellExtents::Ends(ends) };
        cells.add_to(builder, &kind)
    }

    /// The `count` numbers of the array `name` of `group`.
    fn array(
        &self,
        builder: &MeshBuilder,
        group: &CellGroup<'_>,
        name: &str,
        count: usize,
    ) -> Result<AttributeData, ParseError> {
        let found = group.arrays.iter().find(|array| array.name == name);
        let Some(array) = found else {
            let what = format!("<{}> without an array {name}", group.section.element());
            return Err(ParseError::malformed(group.at, what));
        };
        if count > self.most_numbers {
            let what = format!("array `{name}` has {count} numbers, more than the file can hold");
            return Err(ParseError::malformed(array.at, what));
        }
        // While they are decoded, there are the bytes as well.
        let size = scalar_type(&array.type_name).map_or(0, |scalar| 2 * scalar.size());
        builder.check(count.saturating_mul(size) as u64)?;
        let data = values(array, self.document.encoding, self.appended, count)?;
        data.ok_or_else(|| not_numeric(array))
    }
}
