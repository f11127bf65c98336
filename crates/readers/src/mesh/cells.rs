//! Cells as VTK stores them, in both of its formats: turns them into triangles.

use std::ops::Range;

use glam::DVec3;

use super::builder::{CornerRange, MeshBuilder};
use super::surface::{CellShape, SurfaceFaces, shape};
use spherule_frame::{AttributeData, ParseError};

/// A list of cells.
pub struct CellArray {
    /// Where the list is in the file, for errors.
    pub at: usize,
    /// Cells.
    pub count: usize,
    /// Indices of vertices.
    pub connectivity: AttributeData,
    /// Which of the indices belong to a cell.
    pub extents: CellExtents,
}

/// Which part of the connectivity belongs to each cell.
pub enum CellExtents {
    /// In front of the indices of a cell is their number: legacy VTK up to version 4.2.
    Counts,
    /// Where each cell begins, and where the last one ends: legacy VTK from version 5.0 on.
    Starts(AttributeData),
    /// Where each cell ends: VTK XML.
    Ends(AttributeData),
}

/// What cells are.
pub enum CellKind<'a> {
    /// Polygons with any number of corners.
    Polygons,
    /// Strips of triangles.
    Strips,
    /// A number for each, as VTK assigns them.
    Types(&'a AttributeData),
}

/// Number `index` of `data` if it is an integer that is not negative.
pub fn unsigned(data: &AttributeData, index: usize) -> Option<u64> {
    use AttributeData::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    match data {
        I8(v) => u64::try_from(*v.get(index)?).ok(),
        I16(v) => u64::try_from(*v.get(index)?).ok(),
        I32(v) => u64::try_from(*v.get(index)?).ok(),
        I64(v) => u64::try_from(*v.get(index)?).ok(),
        U8(v) => v.get(index).copied().map(u64::from),
        U16(v) => v.get(index).copied().map(u64::from),
        U32(v) => v.get(index).copied().map(u64::from),
        U64(v) => v.get(index).copied(),
        F32(_) | F64(_) => None,
    }
}

impl CellArray {
    /// Calls `show` with the number of each cell and its part of the connectivity.
    ///
    /// # Errors
    /// Those of `show`; [`ParseError::Malformed`] if a part is outside of the connectivity, or begins before the end
    /// of the one before. Therefore the parts together are no longer than the connectivity.
    fn each(
        &self,
        mut show: impl FnMut(usize, Range<usize>) -> Result<(), ParseError>,
    ) -> Result<(), ParseError> {
        let len = self.connectivity.len();
        let mut end = match &self.extents {
            CellExtents::Starts(starts) => self.place(0, unsigned(starts, 0))?,
            CellExtents::Counts | CellExtents::Ends(_) => 0,
        };
        for cell in 0..self.count {
            let (start, next) = match &self.extents {
                CellExtents::Counts => {
                    let corners = self.place(cell, unsigned(&self.connectivity, end))?;
                    (end + 1, corners.saturating_add(end + 1))
                }
                CellExtents::Starts(starts) => (end, self.place(cell, unsigned(starts, cell + 1))?),
                CellExtents::Ends(ends) => (end, self.place(cell, unsigned(ends, cell))?),
            };
            if next < start || next > len {
                let what =
                    format!("cell {cell} has the indices {start} to {next}, there are {len}");
                return Err(ParseError::malformed(self.at, what));
            }
            show(cell, start..next)?;
            end = next;
        }
        Ok(())
    }

    /// A number of the extents as a place in the connectivity.
    fn place(&self, cell: usize, number: Option<u64>) -> Result<usize, ParseError> {
        let place = number.and_then(|number| usize::try_from(number).ok());
        place.ok_or_else(|| {
            let what = format!("the extent of cell {cell} is missing or negative");
            ParseError::malformed(self.at, what)
        })
    }

    /// The corners in `range` of the connectivity, which are among `all`.
    fn corners(
        &self,
        range: Range<usize>,
        all: CornerRange,
    ) -> impl ExactSizeIterator<Item = Result<u32, ParseError>> {
        range.map(move |place| all.vertex(self.at, unsigned(&self.connectivity, place)))
    }

    /// Adds all cells to `builder`, whose corners are the vertices that were added last.
    ///
    /// # Errors
    /// [`ParseError`].
    pub fn add_to(&self, builder: &mut MeshBuilder, kind: &CellKind<'_>) -> Result<(), ParseError> {
        let all = builder.corners();
        match kind {
            CellKind::Polygons => {
                self.each(|_, range| builder.add_polygon(self.corners(range, all)))
            }
            CellKind::Strips => self.each(|_, range| builder.add_strip(self.corners(range, all))),
            CellKind::Types(types) => self.add_typed(builder, types),
        }
    }

    /// Adds cells of several types: the faces of the surface of the volumes, and all polygons that are not a face of
    /// a volume themselves.
    fn add_typed(
        &self,
        builder: &mut MeshBuilder,
        types: &AttributeData,
    ) -> Result<(), ParseError> {
        let all = builder.corners();
        let mut has_volumes = false;
        for cell in 0..self.count {
            has_volumes |= matches!(self.shape(cell, types)?, CellShape::Volume(_));
        }
        let mut surface = SurfaceFaces::default();
        self.each(|cell, range| {
            let corners = range.len();
            let shape = self.shape(cell, types)?;
            if let Some(needed) = shape.corners().filter(|needed| *needed != corners) {
                let what = format!("cell {cell} has {corners} vertices, its type has {needed}");
                return Err(ParseError::malformed(self.at, what));
            }
            let corner = |index: &u8| {
                let place = range.start + usize::from(*index);
                all.vertex(self.at, unsigned(&self.connectivity, place))
            };
            match shape {
                CellShape::Faceless => Ok(()),
                CellShape::Strip => builder.add_strip(self.corners(range, all)),
                CellShape::Polygon if !has_volumes || !(3..=4).contains(&corners) => {
                    builder.add_polygon(self.corners(range, all))
                }
                CellShape::Polygon => {
                    let order = &[0, 1, 2, 3][..corners];
                    surface.add(builder, order.iter().map(corner), None)
                }
                CellShape::Face(order) if has_volumes => {
                    surface.add(builder, order.iter().map(corner), None)
                }
                CellShape::Face(order) => builder.add_polygon(order.iter().map(corner)),
                CellShape::Volume(faces) => {
                    let mut center = DVec3::ZERO;
                    for corner in self.corners(range.clone(), all) {
                        center += builder.position(corner?) / corners as f64;
                    }
                    let mut faces = faces.iter();
                    faces.try_for_each(|face| {
                        surface.add(builder, face.iter().map(corner), Some(center))
                    })
                }
            }
        })?;
        surface.finish(builder)
    }

    fn shape(&self, cell: usize, types: &AttributeData) -> Result<CellShape, ParseError> {
        let number = unsigned(types, cell).ok_or_else(|| {
            ParseError::malformed(self.at, format!("the type of cell {cell} is missing"))
        })?;
        shape(number).ok_or_else(|| {
            ParseError::unsupported(format!(
                "cells of VTK type {number} are not read; write linear triangles, quads, polygons, tetrahedra, \
                 hexahedra, wedges or pyramids"
            ))
        })
    }
}
