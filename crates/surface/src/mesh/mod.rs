//! Triangle meshes: tanks, obstacles and other bodies that are not particles.
//!
//! Triangles are intersected in f64 (`triangle.rs`), so that no ray passes between two triangles with a common edge.

use std::ops::Range;

use glam::Vec3;

mod normals;
mod shape;
mod triangle;

#[cfg(test)]
mod tests;

pub use shape::{MeshSurface, MeshTree};

/// The faces of a mesh that rays can hit. The front of a triangle is the side from which its vertices are
/// counterclockwise; that is the outside of a closed body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum VisibleFaces {
    /// Both sides of all triangles.
    #[default]
    Both,
    /// The front of triangles only.
    Front,
    /// The back of triangles only: one looks into a closed tank.
    Back,
}

/// The normals that shade a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum MeshNormals {
    /// The normals of the triangles.
    #[default]
    Flat,
    /// Means of the normals of adjacent triangles that differ by less than this angle in radians, weighted by the
    /// angles of their corners (Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998).
    Smooth(f32),
}

/// Vertices and triangles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriangleMesh {
    /// Positions, relative to the origin of the sequence, scene units.
    vertices: Vec<Vec3>,
    /// Indices of the vertices of each triangle.
    triangles: Vec<[u32; 3]>,
    /// Unit normals at the corners of each triangle; empty for flat shading.
    corner_normals: Vec<[Vec3; 3]>,
}

/// Greatest number of triangles: their corners have an index.
const MAX_TRIANGLES: usize = u32::MAX as usize / 3;

/// Why triangles are no mesh.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// A triangle has a vertex that does not exist.
    #[error(
        "triangle {triangle} refers to vertex {vertex}, but there are only {vertices} vertices"
    )]
    Vertex {
        /// The triangle, from 0.
        triangle: usize,
        /// The vertex, from 0.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// There are more triangles than indices.
    #[error("{0} triangles, but the limit is {MAX_TRIANGLES}")]
    TooMany(usize),
}

impl TriangleMesh {
    /// The mesh of `triangles`, without those that have no area or a vertex that is not finite; see
    /// [`TriangleMesh::len`].
    ///
    /// # Errors
    /// A triangle has a vertex that does not exist.
    pub fn new(
        vertices: Vec<Vec3>,
        mut triangles: Vec<[u32; 3]>,
        normals: MeshNormals,
    ) -> Result<Self, MeshError> {
        if triangles.len() > MAX_TRIANGLES {
            return Err(MeshError::TooMany(triangles.len()));
        }
        // Check the indices
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(vertex) = corners.iter().find(|v| **v as usize >= vertices.len()) {
                return Err(MeshError::Vertex {
                    triangle,
                    vertex: *vertex,
                    vertices: vertices.len(),
                });
            }
        }
        // Remove triangles that no ray can hit
        triangles.retain(|corners| {
            let corners = corners.map(|v| vertices[v as usize]);
            corners.iter().all(|p| p.is_finite()) && triangle::normal(&corners).is_some()
        });
        let mut mesh = Self { vertices, triangles, corner_normals: Vec::new() };
        if let MeshNormals::Smooth(angle) = normals {
            mesh.corner_normals = normals::smooth(&mesh, angle);
        }
        Ok(mesh)
    }

    /// Number of triangles.
    pub const fn len(&self) -> usize {
        self.triangles.len()
    }

    /// The indices of all triangles.
    #[expect(clippy::cast_possible_truncation, reason = "up to `MAX_TRIANGLES`")]
    fn indices(&self) -> Range<u32> {
        0..self.len() as u32
    }

    /// Whether there are no triangles.
    pub const fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Memory of the arrays, bytes.
    pub const fn bytes(&self) -> usize {
        size_of_val(self.vertices.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.corner_normals.as_slice())
    }

    /// The vertices of a triangle.
    fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.vertices[vertex as usize])
    }

    /// The shading normal at the point of `triangle` with these barycentric `weights`; `normal` for flat shading.
    fn shading_normal(&self, triangle: u32, weights: [f32; 3], normal: Vec3) -> Vec3 {
        let Some(corners) = self.corner_normals.get(triangle as usize) else {
            return normal;
        };
        let sum = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        sum.try_normalize().unwrap_or(normal)
    }
}
