//! Overlapping spheres as one body of one medium: a ray that enters it leaves where it leaves the union,
//! whatever spheres it passes on the way.

use glam::Vec3;

use super::shape::intersect_one_by_one;
use super::spheres::{SphereSurface, sphere_hit};
use super::{Intersection, Intersections, ShadingNormals, Shape, Side};
use crate::accel::Coherence;
use crate::accel::intervals::TreeExit;
use crate::accel::traverse::TreeHit;
use crate::accel::view::TreeView;
use crate::ray::{Ray, RayPacket};

/// Cosine between ray and normal under which a sphere may be touched and no more.
const TOUCHING: f32 = 1e-2;

/// The union of a tree's spheres.
#[derive(Debug, Clone, Copy)]
pub struct UnionSurface<'a> {
    tree: TreeView<'a>,
    /// The same, each for itself.
    spheres: SphereSurface<'a>,
    normals: ShadingNormals,
}

impl<'a> UnionSurface<'a> {
    /// The union of the spheres of `tree`.
    pub fn new(tree: TreeView<'a>) -> Self {
        Self {
            tree,
            spheres: SphereSurface::new(tree),
            normals: ShadingNormals::Sphere,
        }
    }

    /// Shaded by these normals.
    #[must_use]
    pub fn shaded_by(self, normals: ShadingNormals) -> Self {
        Self {
            normals,
            spheres: self.spheres.shaded_by(normals),
            ..self
        }
    }

    fn entry(&self, ray: &Ray) -> Option<Intersection> {
        Some(self.hit(ray, self.tree.entry(ray)?))
    }

    fn hit(&self, ray: &Ray, hit: TreeHit) -> Intersection {
        sphere_hit(&self.tree, ray, hit, &self.normals)
    }

    fn exit(&self, ray: &Ray) -> Option<Intersection> {
        match self.tree.exit(ray) {
            TreeExit::Here(hit) => Some(self.hit(ray, hit)),
            TreeExit::Beyond => None,
            TreeExit::NotInside => self.at_once(ray),
        }
    }

    /// Out where the ray starts, by the sphere that lies before it, or else behind it: it must have come
    /// from some.
    fn at_once(&self, ray: &Ray) -> Option<Intersection> {
        let forth = Ray {
            t_max: f32::INFINITY,
            ..*ray
        };
        let back = Ray::new(ray.at(ray.t_min), -ray.direction);
        let near = |ray: &Ray| self.spheres.crossing(ray, Side::Outside);
        let hit = near(&forth).or_else(|| near(&back))?;
        let point = ray.at(ray.t_min);
        (ray.t_min < ray.t_max).then_some(Intersection {
            t: ray.t_min,
            point,
            normal: ray.direction,
            shading: ray.direction,
            lift: 0.0,
            anchor: point,
            ..hit
        })
    }
}

impl Shape for UnionSurface<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        match side {
            Side::Outside => self.entry(ray),
            Side::Inside => self.exit(ray),
        }
    }

    fn is_connected(&self) -> bool {
        true
    }

    fn side_of(&self, point: Vec3) -> Side {
        if self.tree.contains(point) {
            Side::Inside
        } else {
            Side::Outside
        }
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        if coherence == Coherence::Coherent && inside == 0 {
            self.enter(rays, hits);
            return;
        }
        intersect_one_by_one(self, rays, inside, hits);
    }

    /// Also for rays that start inside: what is met are the surfaces of spheres.
    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        self.spheres.occluded(rays, coherence, lanes)
    }
}

impl UnionSurface<'_> {
    /// Where rays that lie close together enter. From outside all spheres that is the first sphere that they meet,
    /// unless they only touch it.
    fn enter(&self, rays: &mut RayPacket, hits: &mut Intersections) {
        let mut ahead = *rays;
        let mut met = Intersections::default();
        self.spheres
            .intersect(&mut ahead, Coherence::Coherent, 0, &mut met);
        let mut start = None;
        for lane in 0..rays.len() {
            let ray = rays.ray(lane);
            let begins = ray.at(ray.t_min);
            let is_inside = match start {
                Some((at, is_inside)) if at == begins => is_inside,
                _ => self.tree.contains(begins),
            };
            start = Some((begins, is_inside));
            let found = (met.mask >> lane & 1 == 1).then(|| met.get(lane));
            let is_touched = |hit: &Intersection| hit.normal.dot(ray.direction).abs() < TOUCHING;
            let found = if is_inside || found.as_ref().is_some_and(is_touched) {
                self.entry(&ray)
            } else {
                found
            };
            if let Some(hit) = found {
                hits.end_ray(rays, lane, &hit, self.material());
            }
        }
    }
}

#[cfg(test)]
#[path = "union_tests.rs"]
mod tests;
