//! Shapes of particles by their type, as GSD files store them.

use glam::Vec3;

/// The shape of the particles of a type, scene units.
#[derive(Debug, Clone, PartialEq)]
pub enum TypeShape {
    /// The file does not say.
    Unspecified,
    /// Spheres of this radius.
    Sphere(f32),
    /// Ellipsoids with these semi-axes.
    Ellipsoid(Vec3),
    /// Convex hulls of these points, relative to the centre.
    ConvexPolyhedron(Vec<Vec3>),
    /// Closed meshes, relative to the centre.
    Mesh {
        /// Vertices.
        vertices: Vec<Vec3>,
        /// Indices of the vertices of each triangle.
        triangles: Vec<[u32; 3]>,
    },
    /// Spheres with these centres, relative to that of the particle, and radii.
    Spheres(Vec<(Vec3, f32)>),
    /// Another shape, with the name of its kind.
    Other(String),
}

/// The shapes of all types.
#[derive(Debug, Clone, PartialEq)]
pub struct TypeShapes {
    /// The attribute with the types of particles.
    pub attribute: String,
    /// The shape of each type, from type 0 on.
    pub shapes: Vec<TypeShape>,
}
