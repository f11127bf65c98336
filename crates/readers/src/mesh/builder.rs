//! Builds a mesh from vertices and polygons: checks indices, splits polygons into triangles, keeps the budget.

use bytemuck::allocation::try_cast_vec;
use glam::DVec3;

use spherule_frame::{MemoryBudget, ParseError, Positions};

/// The triangles of a file. No triangle refers to a vertex that does not exist.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertices in the length unit of the file. Their coordinates are as stored: they may be infinite or NaN.
    pub vertices: Vec<[f64; 3]>,
    /// Three indices of vertices per triangle, from 0, in the winding order of the file.
    pub triangles: Vec<[u32; 3]>,
}

/// What the message about a mesh that is too large begins with.
const TOO_LARGE: &str = "its mesh in memory is";

/// Items for which a list without items makes room.
const FIRST_ITEMS: usize = 1024;

/// A mesh that grows within a budget.
pub struct MeshBuilder {
    mesh: Mesh,
    corners: CornerRange,
    budget: MemoryBudget,
    /// Bytes in memory beside the mesh.
    held: u64,
}

/// The vertices that a polygon may have as corners.
#[derive(Debug, Clone, Copy)]
pub struct CornerRange {
    first: u32,
    count: u32,
}

impl CornerRange {
    /// Vertices.
    pub(super) const fn count(self) -> u32 {
        self.count
    }

    /// The vertex with `index`, counted from the first of the range; `None` stands for a number that is no index.
    /// `at` is the byte for the error.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there is no such vertex.
    pub fn vertex(self, at: usize, index: Option<u64>) -> Result<u32, ParseError> {
        let Some(index) = index else {
            return Err(ParseError::malformed(at, "a vertex index is negative or no integer"));
        };
        let found = u32::try_from(index).ok().filter(|i| *i < self.count);
        found.map(|i| self.first + i).ok_or_else(|| {
            let count = self.count;
            let what = format!("vertex index {index} is out of range: there are {count} vertices");
            ParseError::malformed(at, what)
        })
    }
}

impl MeshBuilder {
    /// A mesh without vertices, which may take as much memory as `budget`.
    pub const fn new(budget: MemoryBudget) -> Self {
        Self {
            mesh: Mesh { vertices: Vec::new(), triangles: Vec::new() },
            corners: CornerRange { first: 0, count: 0 },
            budget,
            held: 0,
        }
    }

    /// The budget minus what is in memory so far.
    pub(super) const fn left(&self) -> MemoryBudget {
        let vertices = self.mesh.vertices.capacity() * size_of::<[f64; 3]>();
        let triangles = self.mesh.triangles.capacity() * size_of::<[u32; 3]>();
        self.budget.less(self.held.saturating_add((vertices + triangles) as u64))
    }

    /// Checks that the budget allows `more` bytes beside those of the mesh.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`].
    pub fn check(&self, more: u64) -> Result<(), ParseError> {
        if more <= self.left().bytes() { Ok(()) } else { Err(self.budget.exceeded(TOO_LARGE)) }
    }

    /// Counts `bytes` that are in memory beside the mesh.
    pub const fn hold(&mut self, bytes: u64) {
        self.held = self.held.saturating_add(bytes);
    }

    /// Counts `bytes` of [`Self::hold`] that are no longer in memory.
    pub const fn release(&mut self, bytes: u64) {
        self.held = self.held.saturating_sub(bytes);
    }

    /// The vertices that were added last.
    pub const fn corners(&self) -> CornerRange {
        self.corners
    }

    /// Adds vertices. Polygons that follow have them as corners.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`]; [`ParseError::Unsupported`] for more vertices than indices can tell apart.
    pub fn add_vertices(&mut self, positions: Positions) -> Result<(), ParseError> {
        let (first, count) = (self.mesh.vertices.len(), positions.len());
        let range = u32::try_from(first)
            .ok()
            .zip(u32::try_from(count).ok())
            .filter(|(first, count)| first.checked_add(*count).is_some());
        let Some((first, count)) = range else {
            let what = format!("a mesh of {} vertices; at most 4294967295 are read", first + count);
            return Err(ParseError::unsupported(what));
        };
        self.corners = CornerRange { first, count };
        let need = positions.len() as u64 * size_of::<[f64; 3]>() as u64;
        self.check(need.saturating_add(positions.byte_len()))?;
        match positions {
            Positions::F64(points) if first == 0 => match try_cast_vec(points) {
                Ok(vertices) => self.mesh.vertices = vertices,
                Err((_, points)) => {
                    self.mesh.vertices = points.iter().map(|p| p.to_array()).collect()
                }
            },
            Positions::F64(points) => {
                self.mesh.vertices.extend(points.iter().map(|p| p.to_array()));
            }
            Positions::F32(points) => {
                let points = points.iter().map(|p| p.as_dvec3().to_array());
                self.mesh.vertices.extend(points);
            }
        }
        Ok(())
    }

    /// The position of vertex `index`, which [`CornerRange::vertex`] returned.
    pub(super) fn position(&self, index: u32) -> DVec3 {
        let vertex = self.mesh.vertices.get(index as usize);
        DVec3::from_array(*vertex.expect("indices are checked"))
    }

    /// Adds one vertex, which all polygons that follow may have as a corner, and returns its index.
    ///
    /// # Errors
    /// As [`Self::add_vertices`].
    pub fn add_vertex(&mut self, vertex: [f64; 3]) -> Result<u32, ParseError> {
        let left = self.left();
        reserve(&mut self.mesh.vertices, left, self.budget)?;
        let index = u32::try_from(self.mesh.vertices.len()).ok();
        let index = index.filter(|index| *index < u32::MAX).ok_or_else(|| {
            ParseError::unsupported("a mesh of more than 4294967295 vertices, which is not read")
        })?;
        self.mesh.vertices.push(vertex);
        self.corners.count = index + 1;
        Ok(index)
    }

    /// Adds one triangle.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`].
    pub fn add_triangle(&mut self, corners: [u32; 3]) -> Result<(), ParseError> {
        let left = self.left();
        reserve(&mut self.mesh.triangles, left, self.budget)?;
        self.mesh.triangles.push(corners);
        Ok(())
    }

    /// Adds a polygon as a fan of triangles around its first corner, which is exact for convex polygons. Polygons of
    /// fewer than three corners have no area and add nothing.
    ///
    /// # Errors
    /// The first error of `corners`; [`ParseError::TooLarge`].
    pub fn add_polygon(
        &mut self,
        corners: impl IntoIterator<Item = Result<u32, ParseError>>,
    ) -> Result<(), ParseError> {
        let mut corners = corners.into_iter();
        let (Some(first), Some(second)) = (corners.next(), corners.next()) else {
            return Ok(());
        };
        let (first, mut last) = (first?, second?);
        for corner in corners {
            let corner = corner?;
            self.add_triangle([first, last, corner])?;
            last = corner;
        }
        Ok(())
    }

    /// Adds a strip of triangles: each corner from the third on makes one with the two before. Triangles with a
    /// repeated corner only join the parts of a strip and are left out.
    ///
    /// # Errors
    /// As [`Self::add_polygon`].
    pub fn add_strip(
        &mut self,
        corners: impl IntoIterator<Item = Result<u32, ParseError>>,
    ) -> Result<(), ParseError> {
        let mut corners = corners.into_iter();
        let (Some(first), Some(second)) = (corners.next(), corners.next()) else {
            return Ok(());
        };
        let (mut a, mut b) = (first?, second?);
        let mut is_turned = false;
        for corner in corners {
            let c = corner?;
            if a != b && b != c && a != c {
                self.add_triangle(if is_turned { [b, a, c] } else { [a, b, c] })?;
            }
            (a, b) = (b, c);
            is_turned = !is_turned;
        }
        Ok(())
    }

    /// The mesh.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if it has no triangles.
    pub fn finish(mut self) -> Result<Mesh, ParseError> {
        if self.mesh.triangles.is_empty() {
            return Err(ParseError::unsupported(
                "the file has no faces; particles are read as [input]",
            ));
        }
        self.mesh.vertices.shrink_to_fit();
        self.mesh.triangles.shrink_to_fit();
        Ok(self.mesh)
    }
}

/// Makes room for one more item, and for about twice as many items if `left`, the rest of `budget`, allows it.
///
/// # Errors
/// [`ParseError::TooLarge`].
pub(super) fn reserve<T>(
    items: &mut Vec<T>,
    left: MemoryBudget,
    budget: MemoryBudget,
) -> Result<(), ParseError> {
    if items.len() < items.capacity() {
        return Ok(());
    }
    let allowed = usize::try_from(left.bytes()).unwrap_or(usize::MAX) / size_of::<T>();
    let more = items.len().max(FIRST_ITEMS).min(allowed);
    if more == 0 {
        return Err(budget.exceeded(TOO_LARGE));
    }
    items.try_reserve_exact(more).map_err(|_| {
        let there = items.len() as u64 * size_of::<T>() as u64;
        let there = MemoryBudget::UNLIMITED.less(u64::MAX - there);
        there.exceeded(TOO_LARGE)
    })
}
