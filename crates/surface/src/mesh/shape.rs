//! The hierarchy of a mesh, and the mesh as a shape.

use std::fmt;

use glam::{DVec3, Vec3};

use super::triangle::{ShearedRay, TriangleHit, normal};
use super::{TriangleMesh, VisibleFaces};
use crate::hierarchy::{BUILT_BYTES, Hierarchy, single};
use crate::{Intersection, MaterialId, Shape, Side, SurfaceBytes};
use spherule_tree::accel::Coherence;
use spherule_tree::math::lanes_in;
use spherule_tree::ray::{Ray, RayPacket};

/// Distance by which rays step off a surface, in units of the rounding of the largest coordinate.
const OFFSET: f32 = 8.0 * f32::EPSILON;

/// A mesh and its hierarchy.
pub struct MeshTree {
    mesh: TriangleMesh,
    hierarchy: Hierarchy,
    /// The largest coordinate of a vertex.
    extent: f32,
}

impl fmt::Debug for MeshTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let triangles = self.mesh.len();
        f.debug_struct("MeshTree").field("triangles", &triangles).finish_non_exhaustive()
    }
}

impl MeshTree {
    /// Builds the hierarchy.
    pub fn new(mesh: TriangleMesh) -> Self {
        let box_of = |triangle| {
            let [a, b, c] = mesh.corners(triangle);
            [a.min(b).min(c), a.max(b).max(c)].map(|corner| corner.as_dvec3())
        };
        let hierarchy = Hierarchy::new(mesh.indices().end, box_of);
        let extent =
            hierarchy.bounds().map_or(0.0, |[min, max]| min.abs().max(max.abs()).max_element());
        Self { mesh, hierarchy, extent }
    }

    /// The mesh.
    pub const fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Memory of the mesh and its hierarchy, bytes.
    pub const fn bytes(&self) -> usize {
        self.mesh.bytes() + self.hierarchy.bytes()
    }

    /// Memory of the mesh in a file of `stored` bytes, bytes: while it is read and its hierarchy is built, and
    /// afterwards. Of the formats, binary PLY needs most: a triangle has 19 bytes in the file and about 84 in memory.
    pub const fn predicted_bytes(stored: u64) -> SurfaceBytes {
        SurfaceBytes { building: stored.saturating_mul(16), kept: stored.saturating_mul(5) }
    }

    /// Memory while the hierarchy is built, bytes.
    pub const fn building_bytes(&self) -> u64 {
        self.mesh.bytes() as u64 + self.mesh.len() as u64 * BUILT_BYTES
    }

    /// The lowest and the highest corner of its box; None without triangles.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        self.hierarchy.bounds()
    }

    /// The nearest intersection with `faces`, and its triangle.
    fn nearest(&self, ray: &Ray, faces: VisibleFaces) -> Option<(u32, TriangleHit)> {
        let sheared = ShearedRay::new(ray);
        self.hierarchy.nearest(ray, |triangle| {
            let hit = self.hit(&sheared, ray, triangle, faces)?;
            Some((hit.t, hit))
        })
    }

    /// Whether the ray hits any of `faces`.
    fn is_hit(&self, ray: &Ray, faces: VisibleFaces) -> bool {
        let sheared = ShearedRay::new(ray);
        let is_hit = |triangle| self.hit(&sheared, ray, triangle, faces).is_some();
        self.hierarchy.is_hit(ray, is_hit)
    }

    /// The intersection of `ray` with `triangle`, if it is within the range of the ray and on one of `faces`.
    fn hit(
        &self,
        sheared: &ShearedRay,
        ray: &Ray,
        triangle: u32,
        faces: VisibleFaces,
    ) -> Option<TriangleHit> {
        let hit = sheared.intersect(&self.mesh.corners(triangle))?;
        let is_visible = match faces {
            VisibleFaces::Both => true,
            VisibleFaces::Front => hit.is_front,
            VisibleFaces::Back => !hit.is_front,
        };
        let t = single(hit.t);
        (is_visible && t >= ray.t_min && t < ray.t_max).then_some(hit)
    }
}

/// A mesh as a shape.
#[derive(Clone, Copy)]
pub struct MeshSurface<'a> {
    tree: &'a MeshTree,
    faces: VisibleFaces,
    material: MaterialId,
}

impl<'a> MeshSurface<'a> {
    /// The visible `faces` of a mesh with this material.
    pub const fn new(tree: &'a MeshTree, faces: VisibleFaces, material: MaterialId) -> Self {
        Self { tree, faces, material }
    }
}

impl Shape for MeshSurface<'_> {
    fn crossing(&self, ray: &Ray, _side: Side) -> Option<Intersection> {
        let (triangle, hit) = self.tree.nearest(ray, self.faces)?;
        let mesh = &self.tree.mesh;
        let corners = mesh.corners(triangle);
        let normal = normal(&corners)?;
        // Compute the point from the vertices, which is more accurate than along the ray
        let exact: DVec3 = (0..3).map(|i| corners[i].as_dvec3() * hit.weights[i]).sum();
        let point = exact.as_vec3();
        let smooth = mesh.shading_normal(triangle, hit.weights.map(single), normal);
        // The ray must see both normals from the same side
        let is_consistent = smooth.dot(ray.direction) * normal.dot(ray.direction) > 0.0;
        let largest = self.tree.extent.max(ray.origin.abs().max_element());
        Some(Intersection {
            t: single(hit.t),
            point,
            normal,
            shading: if is_consistent { smooth } else { normal },
            lift: 0.0,
            radius: f32::INFINITY,
            particle: triangle,
            offset: OFFSET * largest,
            anchor: point,
        })
    }

    fn material(&self) -> MaterialId {
        self.material
    }

    fn occluded(&self, rays: &RayPacket, _coherence: Coherence, lanes: u32) -> u32 {
        lanes_in(lanes).fold(0, |hit_lanes, lane| {
            let ray = rays.ray(lane);
            let is_hit = ray.t_max > ray.t_min && self.tree.is_hit(&ray, self.faces);
            hit_lanes | u32::from(is_hit) << lane
        })
    }
}
