//! The hierarchy of a mesh, and the mesh as a shape.

use std::fmt;
use std::time::Duration;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::RayHit;
use rayon::prelude::*;

use super::triangle::{ShearedRay, TriangleHit, normal};
use super::{TriangleMesh, VisibleFaces};
use crate::accel::Coherence;
use crate::math::lanes_in;
use crate::ray::{Ray, RayPacket};
use crate::surface::{Intersection, MaterialId, Shape, Side};

/// Distance by which rays step off a surface, in units of the rounding of the largest coordinate.
const OFFSET: f32 = 8.0 * f32::EPSILON;

/// Distance by which boxes are larger than their triangles, as a fraction of the size of the mesh, so that the
/// rounding of the traversal never loses a triangle.
const PADDING: f32 = 8.0 * f32::EPSILON;

/// Distance before the box of the mesh at which rays start, as a fraction of its size. `obvhs` ignores boxes in the
/// first 1e-4 of a ray.
const LEAD: f64 = 1e-3;

/// `value` in single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounds")]
const fn single(value: f64) -> f32 {
    value as f32
}

/// A mesh and its hierarchy.
pub struct MeshTree {
    mesh: TriangleMesh,
    bvh: CwBvh,
    space: BvhSpace,
    /// The largest coordinate of a vertex.
    extent: f32,
}

/// The coordinates of the hierarchy: the box of the mesh is centred, and its longest side is 2.
struct BvhSpace {
    center: DVec3,
    /// Half the size of the mesh.
    half: DVec3,
    scale: f64,
}

impl BvhSpace {
    fn new(min: DVec3, max: DVec3) -> Self {
        let half = 0.5 * (max - min);
        let size = half.max_element();
        Self {
            center: 0.5 * (min + max),
            half,
            scale: if size > 0.0 { 1.0 / size } else { 1.0 },
        }
    }

    fn point(&self, point: DVec3) -> Vec3 {
        ((point - self.center) * self.scale).as_vec3()
    }

    /// The distances at which a ray enters and leaves the box of the mesh; None if it misses the box.
    fn range(&self, ray: &Ray) -> Option<[f64; 2]> {
        let (origin, direction) = (
            ray.origin.as_dvec3() - self.center,
            ray.direction.as_dvec3(),
        );
        let padding = f64::from(PADDING) / self.scale;
        let mut range = [f64::from(ray.t_min), f64::from(ray.t_max)];
        for axis in 0..3 {
            let half = self.half[axis] + padding;
            let slab = [-half - origin[axis], half - origin[axis]];
            if direction[axis] == 0.0 {
                if slab[0] > 0.0 || slab[1] < 0.0 {
                    return None;
                }
                continue;
            }
            let [a, b] = slab.map(|x| x / direction[axis]);
            range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
        }
        (range[0] <= range[1]).then_some(range)
    }

    /// The ray in these coordinates. It starts close to the box of the mesh, since its rounding grows with the
    /// distance from its origin. The second value is the distance at which it starts.
    fn ray(&self, ray: &Ray) -> Option<(obvhs::ray::Ray, f64)> {
        if !(ray.origin.is_finite() && ray.direction.is_finite()) {
            return None;
        }
        let [start, end] = self.range(ray)?;
        let start = start - LEAD / self.scale;
        let origin = self.point(ray.origin.as_dvec3() + ray.direction.as_dvec3() * start);
        // Without negative zeros, whose reciprocal has the wrong sign for `obvhs`
        let direction = ray.direction + Vec3::ZERO;
        let length = single((end - start) * self.scale);
        let t_max = length + PADDING * (1.0 + length);
        Some((
            obvhs::ray::Ray::new(origin.into(), direction.into(), 0.0, t_max),
            start,
        ))
    }

    /// The distance `t` along a ray as a distance along the ray of the hierarchy that starts at `start`. It is
    /// slightly larger, so that boxes at the same distance are still entered: they may contain a triangle with a lower
    /// index.
    fn distance(&self, t: f64, start: f64) -> f32 {
        let t = single((t - start) * self.scale);
        t + 2.0 * PADDING * (1.0 + t)
    }
}

impl fmt::Debug for MeshTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let triangles = self.mesh.len();
        f.debug_struct("MeshTree")
            .field("triangles", &triangles)
            .finish_non_exhaustive()
    }
}

impl MeshTree {
    /// Builds the hierarchy.
    pub fn new(mesh: TriangleMesh) -> Self {
        let corners = mesh.triangles.iter().flatten();
        let corners = corners.map(|v| mesh.vertices[*v as usize]);
        let (min, max) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), p| {
            (min.min(p), max.max(p))
        });
        let space = BvhSpace::new(min.as_dvec3(), max.as_dvec3());
        let padding = Vec3::splat(PADDING);
        let boxes: Vec<Aabb> = mesh
            .indices()
            .into_par_iter()
            .map(|triangle| {
                let [a, b, c] = mesh.corners(triangle).map(|p| space.point(p.as_dvec3()));
                let (min, max) = (a.min(b).min(c) - padding, a.max(b).max(c) + padding);
                Aabb::new(min.into(), max.into())
            })
            .collect();
        let bvh = match boxes.is_empty() {
            true => CwBvh::default(),
            false => build_cwbvh(
                &boxes,
                BvhBuildParams::medium_build(),
                &mut Duration::default(),
            ),
        };
        Self {
            mesh,
            bvh,
            space,
            extent: min.abs().max(max.abs()).max_element(),
        }
    }

    /// The mesh.
    pub const fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Memory of the mesh and its hierarchy, bytes.
    pub const fn bytes(&self) -> usize {
        self.mesh.bytes()
            + size_of_val(self.bvh.nodes.as_slice())
            + size_of_val(self.bvh.primitive_indices.as_slice())
    }

    /// The lowest and the highest corner of its box; None without triangles.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let BvhSpace { center, half, .. } = self.space;
        let corners = [center - half, center + half].map(|corner| corner.as_vec3());
        (!self.mesh.is_empty()).then_some(corners)
    }

    /// The nearest intersection with `faces`, and its triangle.
    fn nearest(&self, ray: &Ray, faces: VisibleFaces) -> Option<(u32, TriangleHit)> {
        if self.mesh.is_empty() {
            return None;
        }
        let (traversal, start) = self.space.ray(ray)?;
        let sheared = ShearedRay::new(ray);
        let mut best: Option<(f32, u32, TriangleHit)> = None;
        self.bvh
            .ray_traverse(traversal, &mut RayHit::none(), |_, slot| {
                let triangle = self.bvh.primitive_indices[slot];
                let Some(hit) = self.hit(&sheared, ray, triangle, faces) else {
                    return f32::INFINITY;
                };
                let t = single(hit.t);
                if best.is_none_or(|(best_t, index, _)| (t, triangle) < (best_t, index)) {
                    best = Some((t, triangle, hit));
                }
                self.space.distance(hit.t, start)
            });
        best.map(|(_, triangle, hit)| (triangle, hit))
    }

    /// Whether the ray hits any of `faces`.
    fn is_hit(&self, ray: &Ray, faces: VisibleFaces) -> bool {
        let Some((traversal, _)) = self.space.ray(ray).filter(|_| !self.mesh.is_empty()) else {
            return false;
        };
        let sheared = ShearedRay::new(ray);
        !self.bvh.ray_traverse_miss(traversal, |_, slot| {
            let triangle = self.bvh.primitive_indices[slot];
            match self.hit(&sheared, ray, triangle, faces) {
                Some(_) => 0.0,
                None => f32::INFINITY,
            }
        })
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
        Self {
            tree,
            faces,
            material,
        }
    }
}

impl Shape for MeshSurface<'_> {
    fn crossing(&self, ray: &Ray, _side: Side) -> Option<Intersection> {
        let (triangle, hit) = self.tree.nearest(ray, self.faces)?;
        let mesh = &self.tree.mesh;
        let corners = mesh.corners(triangle);
        let normal = normal(&corners)?;
        // Compute the point from the vertices, which is more accurate than along the ray
        let point: DVec3 = (0..3).map(|i| corners[i].as_dvec3() * hit.weights[i]).sum();
        let point = point.as_vec3();
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
