//! The mesh of grains: a closed surface of triangles.

use glam::{DVec3, Vec3};
use thiserror::Error;

use crate::mesh::{MeshError, MeshNormals, MeshTree, TriangleMesh};

mod hull;
mod spheres;

pub use spheres::GrainSphere;

/// Greatest number of triangles of the mesh of a grain.
pub const MAX_GRAIN_TRIANGLES: usize = 1_000_000;

/// Greatest number of different points of a convex hull: the time grows with its square.
pub const MAX_HULL_POINTS: usize = 10_000;

/// Greatest number of spheres of a grain.
pub const MAX_GRAIN_SPHERES: usize = 1000;

/// Triangles of a sphere of a grain share a smooth normal up to this angle, radians: it is greater than that between
/// adjacent triangles of the coarsest spheres.
const SPHERE_CREASE: f32 = 0.8;

/// Why triangles are not the surface of a grain.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GrainMeshError {
    /// Triangles refer to vertices that do not exist.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There are too many triangles.
    #[error(
        "the mesh of a grain has {0} triangles, but the limit is {MAX_GRAIN_TRIANGLES}; simplify it"
    )]
    TooMany(usize),
    /// There are no triangles.
    #[error("the mesh of a grain has no triangles")]
    Empty,
    /// A vertex is not finite.
    #[error("vertex {0} of the mesh of a grain is not finite")]
    NotFinite(usize),
    /// An edge does not have two triangles.
    #[error(
        "the mesh of a grain is not closed: the edge from {} to {} has {triangles}, but needs two",
        shown(ends[0]),
        shown(ends[1])
    )]
    Open {
        /// The ends of the edge.
        ends: [Vec3; 2],
        /// How many triangles it has, in words.
        triangles: EdgeTriangles,
    },
    /// Both triangles of an edge have it in the same direction.
    #[error(
        "the mesh of a grain has no outside: the triangles at the edge from {} to {} have opposite orientations",
        shown(ends[0]),
        shown(ends[1])
    )]
    Orientation {
        /// The ends of the edge.
        ends: [Vec3; 2],
    },
    /// There are too many spheres.
    #[error("{0} spheres, but a grain has at most {MAX_GRAIN_SPHERES}")]
    TooManySpheres(usize),
    /// There are too many points for a convex hull.
    #[error("{0} vertices, but a convex hull takes at most {MAX_HULL_POINTS}; simplify the mesh")]
    TooManyPoints(usize),
    /// Points have no convex hull with a volume.
    #[error("the {0} points of a convex grain are in a plane, so it has no volume")]
    Flat(usize),
}

/// Number of triangles at an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EdgeTriangles(pub usize);

impl std::fmt::Display for EdgeTriangles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            1 => f.write_str("one triangle"),
            count => write!(f, "{count} triangles"),
        }
    }
}

fn shown(point: Vec3) -> String {
    format!("({}, {}, {})", point.x, point.y, point.z)
}

/// A closed mesh with its hierarchy. It is stored once for all grains.
#[derive(Debug)]
pub struct GrainMesh {
    tree: MeshTree,
    /// The middle of its box and half the size of that.
    extent: [DVec3; 2],
    /// Radius of a sphere around the origin.
    radius: f64,
}

impl GrainMesh {
    /// The mesh of `triangles`, indices of `vertices`. Vertices in the same place count as one, as in STL files.
    /// Triangles are turned if they are seen from outside as clockwise.
    ///
    /// # Errors
    /// The mesh is not closed, too large, or not a mesh.
    pub fn new(
        vertices: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        normals: MeshNormals,
    ) -> Result<Self, GrainMeshError> {
        // Check the size, and the indices and places of vertices
        if triangles.len() > MAX_GRAIN_TRIANGLES {
            return Err(GrainMeshError::TooMany(triangles.len()));
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(vertex) = corners.iter().find(|v| **v as usize >= vertices.len()) {
                let (vertex, vertices) = (*vertex, vertices.len());
                return Err(MeshError::Vertex { triangle, vertex, vertices }.into());
            }
        }
        if let Some(vertex) = vertices.iter().position(|vertex| !vertex.is_finite()) {
            return Err(GrainMeshError::NotFinite(vertex));
        }
        // Remove triangles that became edges when vertices were joined, and check that the others are closed
        let joined = join_vertices(&vertices);
        let mut triangles: Vec<[u32; 3]> =
            triangles.iter().map(|corners| corners.map(|v| joined[v as usize])).collect();
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        if triangles.is_empty() {
            return Err(GrainMeshError::Empty);
        }
        check_edges(&vertices, &triangles)?;
        if volume(&vertices, &triangles) < 0.0 {
            for corners in &mut triangles {
                corners.swap(1, 2);
            }
        }
        Self::of(TriangleMesh::new(vertices, triangles, normals)?)
    }

    /// The convex hull of `points`: a convex polyhedron, of which GSD files store the vertices.
    ///
    /// # Errors
    /// The points are in a plane, not finite, or too many.
    pub fn convex(points: &[Vec3]) -> Result<Self, GrainMeshError> {
        if let Some(vertex) = points.iter().position(|point| !point.is_finite()) {
            return Err(GrainMeshError::NotFinite(vertex));
        }
        // Take each place once
        let joined = (0..).zip(join_vertices(points)).filter(|(vertex, first)| vertex == first);
        let points: Vec<Vec3> = joined.map(|(vertex, _)| points[vertex as usize]).collect();
        if points.len() > MAX_HULL_POINTS {
            return Err(GrainMeshError::TooManyPoints(points.len()));
        }
        let triangles = hull::triangles(&points).ok_or(GrainMeshError::Flat(points.len()))?;
        Self::new(points, triangles, MeshNormals::Flat)
    }

    /// Several spheres as one body, made of triangles.
    ///
    /// # Errors
    /// There is no sphere, there are too many, or one of them is not finite.
    pub fn spheres(spheres: &[GrainSphere]) -> Result<Self, GrainMeshError> {
        if spheres.len() > MAX_GRAIN_SPHERES {
            return Err(GrainMeshError::TooManySpheres(spheres.len()));
        }
        // Take each sphere once
        let mut different: Vec<GrainSphere> = Vec::new();
        for sphere in spheres {
            if sphere.radius > 0.0 && !different.contains(sphere) {
                different.push(*sphere);
            }
        }
        let (vertices, triangles) = spheres::triangles(&different);
        Self::new(vertices, triangles, MeshNormals::Smooth(SPHERE_CREASE))
    }

    fn of(mesh: TriangleMesh) -> Result<Self, GrainMeshError> {
        let tree = MeshTree::new(mesh);
        let [min, max] = tree.bounds().ok_or(GrainMeshError::Empty)?.map(|c| c.as_dvec3());
        let farthest = min.abs().max(max.abs());
        Ok(Self { tree, extent: [0.5 * (min + max), 0.5 * (max - min)], radius: farthest.length() })
    }

    /// Number of triangles.
    pub const fn triangle_count(&self) -> usize {
        self.tree.mesh().len()
    }

    /// Memory of the mesh and its hierarchy, bytes.
    pub const fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// The mesh and its hierarchy.
    pub(super) const fn tree(&self) -> &MeshTree {
        &self.tree
    }

    /// The middle of its box and half the size of that.
    pub(super) const fn extent(&self) -> [DVec3; 2] {
        self.extent
    }

    /// Radius of a sphere around the origin.
    pub const fn radius(&self) -> f64 {
        self.radius
    }
}

/// For each vertex, the first one in the same place.
fn join_vertices(vertices: &[Vec3]) -> Vec<u32> {
    // Without negative zeros
    let place = |vertex: u32| (vertices[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..spherule_tree::order::index_u32(vertices.len())).collect();
    order.sort_by_key(|vertex| (place(*vertex), *vertex));
    let mut joined = order.clone();
    let mut first = None;
    for vertex in order {
        let same = first.filter(|first| place(*first) == place(vertex));
        first = Some(same.unwrap_or(vertex));
        joined[vertex as usize] = same.unwrap_or(vertex);
    }
    joined
}

/// Checks that each edge has two triangles, which have it in opposite directions.
fn check_edges(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Result<(), GrainMeshError> {
    // Sort the edges, each with its direction
    let mut edges: Vec<([u32; 2], bool)> = triangles
        .iter()
        .flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])
        .map(|[a, b]| ([a.min(b), a.max(b)], a < b))
        .collect();
    edges.sort_unstable();
    // Look at the triangles of each
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        let ends = same[0].0.map(|vertex| vertices[vertex as usize]);
        if same.len() != 2 {
            return Err(GrainMeshError::Open { ends, triangles: EdgeTriangles(same.len()) });
        }
        if same[0].1 == same[1].1 {
            return Err(GrainMeshError::Orientation { ends });
        }
    }
    Ok(())
}

/// Six times the volume, positive if triangles are counterclockwise from outside.
fn volume(vertices: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let volume = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|vertex| vertices[vertex as usize].as_dvec3());
        a.dot(b.cross(c))
    };
    triangles.iter().map(volume).sum()
}
