//! The types of VTK's cells, and the surface of a mesh of volumes: the faces that belong to one volume only.

use glam::DVec3;

use super::builder::{MeshBuilder, reserve};
use spherule_frame::ParseError;

/// What of a cell is visible.
#[derive(Debug, Clone, Copy)]
pub(super) enum CellShape {
    /// Points and lines.
    Faceless,
    /// The corners in their order.
    Polygon,
    /// The corners in another order.
    Face(&'static [u8]),
    /// A strip of triangles.
    Strip,
    /// The corners of each face, in the order around it.
    Volume(&'static [&'static [u8]]),
}

impl CellShape {
    /// The number of corners, if all cells of this shape have the same.
    pub(super) fn corners(self) -> Option<usize> {
        let all = match self {
            Self::Faceless | Self::Polygon | Self::Strip => return None,
            Self::Face(order) => order.iter().max(),
            Self::Volume(faces) => faces.iter().copied().flatten().max(),
        };
        all.map(|last| usize::from(*last) + 1)
    }
}

const PIXEL: &[u8] = &[0, 1, 3, 2];
const TETRA: &[&[u8]] = &[&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]];
const VOXEL: &[&[u8]] =
    &[&[0, 4, 6, 2], &[1, 3, 7, 5], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 2, 3, 1], &[4, 5, 7, 6]];
const HEXAHEDRON: &[&[u8]] =
    &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 7, 6, 2], &[0, 3, 2, 1], &[4, 5, 6, 7]];
const WEDGE: &[&[u8]] = &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]];
const PYRAMID: &[&[u8]] = &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];

/// The shape of cells of type `number` (`vtkCellType.h`); `None` for those that are not read.
pub(super) const fn shape(number: u64) -> Option<CellShape> {
    Some(match number {
        0..=4 => CellShape::Faceless,
        5 => CellShape::Face(&[0, 1, 2]),
        6 => CellShape::Strip,
        7 => CellShape::Polygon,
        8 => CellShape::Face(PIXEL),
        9 => CellShape::Face(&[0, 1, 2, 3]),
        10 => CellShape::Volume(TETRA),
        11 => CellShape::Volume(VOXEL),
        12 => CellShape::Volume(HEXAHEDRON),
        13 => CellShape::Volume(WEDGE),
        14 => CellShape::Volume(PYRAMID),
        _ => return None,
    })
}

/// Stands for the fourth corner of a triangle. No vertex has this index.
const NONE: u32 = u32::MAX;

/// A triangle or quad.
struct Face {
    corners: [u32; 4],
    /// The corners sorted: the same for all faces with these corners.
    key: [u32; 4],
    /// Its place among all faces.
    place: u32,
    is_of_volume: bool,
}

/// Faces of volumes, and polygons that may be such a face.
#[derive(Default)]
pub(super) struct SurfaceFaces {
    faces: Vec<Face>,
}

impl SurfaceFaces {
    /// Adds a face of three or four `corners`. If it belongs to a volume, `center` is inside of that. The memory counts
    /// as that of `builder`.
    ///
    /// # Errors
    /// The first error of `corners`; [`ParseError::TooLarge`].
    pub(super) fn add(
        &mut self,
        builder: &MeshBuilder,
        corners: impl Iterator<Item = Result<u32, ParseError>>,
        center: Option<DVec3>,
    ) -> Result<(), ParseError> {
        let mut face = [NONE; 4];
        let mut count = 0;
        for (to, corner) in face.iter_mut().zip(corners) {
            *to = corner?;
            count += 1;
        }
        let held = self.faces.capacity() * size_of::<Face>();
        let left = builder.left();
        reserve(&mut self.faces, left.less(held as u64), left)?;
        let place = u32::try_from(self.faces.len())
            .map_err(|_| ParseError::unsupported("cells with more than 4294967295 faces"))?;
        let mut key = face;
        key.sort_unstable();
        if center.is_some_and(|center| is_inside_out(builder, &face[..count], center)) {
            face[..count].reverse();
        }
        self.faces.push(Face { corners: face, key, place, is_of_volume: center.is_some() });
        Ok(())
    }

    /// Adds the surface to `builder`, in the order of the cells.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`].
    pub(super) fn finish(mut self, builder: &mut MeshBuilder) -> Result<(), ParseError> {
        let held = (self.faces.capacity() * size_of::<Face>()) as u64;
        builder.hold(held);
        // Bring equal faces together, those of volumes first
        let order = |face: &Face| (face.key, !face.is_of_volume, face.place);
        self.faces.sort_unstable_by_key(order);
        let mut kept = 0;
        let mut start = 0;
        while start < self.faces.len() {
            let (faces, end) = same_faces(&self.faces, start);
            // A polygon on the face of a volume is that face once more.
            let keep = match faces {
                0 => start..end,
                1 => start..start + 1,
                _ => start..start,
            };
            for index in keep {
                self.faces.swap(kept, index);
                kept += 1;
            }
            start = end;
        }
        self.faces.truncate(kept);
        self.faces.sort_unstable_by_key(|face| face.place);
        for face in &self.faces {
            let corners = face.corners.iter().filter(|corner| **corner != NONE);
            builder.add_polygon(corners.map(|corner| Ok(*corner)))?;
        }
        builder.release(held);
        Ok(())
    }
}

/// How many of the faces equal to face `start` belong to volumes, and where they end.
fn same_faces(faces: &[Face], start: usize) -> (usize, usize) {
    let rest = faces.get(start..).unwrap_or_default();
    let same = rest.iter().take_while(|face| face.key == rest[0].key);
    let (mut of_volumes, mut all) = (0, 0);
    for face in same {
        of_volumes += usize::from(face.is_of_volume);
        all += 1;
    }
    (of_volumes, start + all)
}

/// Whether the normal of `face` points towards `center`: programs disagree about the order of the corners of a volume.
fn is_inside_out(builder: &MeshBuilder, face: &[u32], center: DVec3) -> bool {
    let mut points = face.iter().map(|corner| builder.position(*corner));
    let (Some(a), Some(b), Some(c)) = (points.next(), points.next(), points.next()) else {
        return false;
    };
    // Of a quad, the diagonals.
    let (normal, middle) = match points.next() {
        Some(d) => ((c - a).cross(d - b), (a + b + c + d) / 4.0),
        None => ((b - a).cross(c - a), (a + b + c) / 3.0),
    };
    normal.dot(middle - center) < 0.0
}
