//! Overlapping spheres as one connected body: a ray that enters it leaves where it leaves the union, whatever spheres
//! it passes through on the way.

use glam::Vec3;

use super::shape::intersect_one_by_one;
use super::spheres::{SphereSurface, sphere_hit};
use super::{CutShape, Intersection, Intersections, ShadingNormals, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::accel::intervals::TreeExit;
use spherule_tree::accel::traverse::TreeHit;
use spherule_tree::accel::view::TreeView;
use spherule_tree::ray::{Ray, RayPacket};

/// Cosine between ray and normal below which a ray may only touch a sphere.
const TOUCHING: f32 = 1e-2;

/// The union of a tree's spheres.
#[derive(Debug, Clone, Copy)]
pub struct UnionSurface<'a> {
    tree: TreeView<'a>,
    /// The same spheres as separate bodies.
    spheres: SphereSurface<'a>,
    normals: ShadingNormals,
}

impl<'a> UnionSurface<'a> {
    /// The union of the spheres of `tree`.
    pub fn new(tree: TreeView<'a>) -> Self {
        Self { tree, spheres: SphereSurface::new(tree), normals: ShadingNormals::Sphere }
    }

    /// Sets the shading normals.
    #[must_use]
    pub fn with_normals(self, normals: ShadingNormals) -> Self {
        Self { normals, spheres: self.spheres.with_normals(normals), ..self }
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
            TreeExit::NotInside => self.exit_at_start(ray),
        }
    }

    /// Exit at the start of the ray, with the particle of the next sphere ahead or else behind it: the ray must have
    /// come from one of them.
    fn exit_at_start(&self, ray: &Ray) -> Option<Intersection> {
        let forward = Ray { t_max: f32::INFINITY, ..*ray };
        let backward = Ray::new(ray.at(ray.t_min), -ray.direction);
        let nearest_sphere = |ray: &Ray| self.spheres.crossing(ray, Side::Outside);
        let hit = nearest_sphere(&forward).or_else(|| nearest_sphere(&backward))?;
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
        if self.tree.contains(point) { Side::Inside } else { Side::Outside }
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        if coherence == Coherence::Coherent && inside == 0 {
            self.intersect_coherent(rays, hits);
            return;
        }
        intersect_one_by_one(self, rays, inside, hits);
    }

    /// The spheres that contain the point, weighted by `1 - (d/r)^2` at the distance d from the centre of a sphere with the
    /// radius r, so that attributes are continuous inside.
    fn blend_at(&self, point: Vec3, _time: f32, each: &mut dyn FnMut(u32, f32)) {
        let mut rays = RayPacket::default();
        rays.push(&Ray { t_max: f32::MIN_POSITIVE, ..Ray::new(point, Vec3::X) });
        let mut found = Vec::new();
        self.spheres.visit_chords(&rays, 1, &mut |_, particle, radius, [near, far]| {
            // The product of both distances is the power of the point
            let weight = -near * far / (radius * radius);
            if weight > 0.0 {
                found.push((particle, weight));
            }
        });
        // Trees with copies visit a sphere several times
        found.sort_unstable_by_key(|(particle, _)| *particle);
        found.dedup_by_key(|(particle, _)| *particle);
        for (particle, weight) in found {
            each(particle, weight);
        }
    }

    /// Also correct for rays that start inside: they hit the surfaces of the spheres.
    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        self.spheres.occluded(rays, coherence, lanes)
    }
}

impl UnionSurface<'_> {
    /// Entries of coherent rays. A ray that starts outside all spheres enters at the first sphere that it hits,
    /// unless it only touches that sphere.
    fn intersect_coherent(&self, rays: &mut RayPacket, hits: &mut Intersections) {
        // Find the first spheres with packet traversal
        let mut shortened = *rays;
        let mut sphere_hits = Intersections::default();
        self.spheres.intersect(&mut shortened, Coherence::Coherent, 0, &mut sphere_hits);
        let mut start = None;
        for lane in 0..rays.len() {
            let ray = rays.ray(lane);
            // Determine whether the ray starts inside; most rays have the same origin
            let origin = ray.at(ray.t_min);
            let is_inside = match start {
                Some((at, is_inside)) if at == origin => is_inside,
                _ => self.tree.contains(origin),
            };
            start = Some((origin, is_inside));
            // Trace rays that start inside, or only touch a sphere, alone
            let found = (sphere_hits.mask >> lane & 1 == 1).then(|| sphere_hits.get(lane));
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
