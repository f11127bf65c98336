//! Overlapping spheres as one body of one medium: a ray that enters it leaves where it leaves the union,
//! whatever spheres it passes on the way.

use glam::Vec3;

use super::spheres::{SphereSurface, sphere_hit};
use super::{ShadingNormals, Side, Surface, SurfaceHit};
use crate::accel::intervals::TreeExit;
use crate::accel::traverse::TreeHit;
use crate::accel::view::TreeView;
use crate::ray::{PACKET_SIZE, Ray, RayPacket};

/// Cosine between ray and normal under which a sphere may be touched and no more.
const TOUCHING: f32 = 1e-2;

/// The union of a tree's spheres.
#[derive(Debug, Clone, Copy)]
pub struct MediumSurface<'a> {
    tree: TreeView<'a>,
    /// The same, each for itself.
    spheres: SphereSurface<'a>,
    normals: ShadingNormals,
}

impl<'a> MediumSurface<'a> {
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

    fn entry(&self, ray: &Ray) -> Option<SurfaceHit> {
        Some(self.hit(ray, self.tree.entry(ray)?))
    }

    fn hit(&self, ray: &Ray, hit: TreeHit) -> SurfaceHit {
        sphere_hit(&self.tree, ray, hit, &self.normals)
    }

    fn exit(&self, ray: &Ray) -> Option<SurfaceHit> {
        match self.tree.exit(ray) {
            TreeExit::Here(hit) => Some(self.hit(ray, hit)),
            TreeExit::Beyond => None,
            TreeExit::NotInside => self.at_once(ray),
        }
    }

    /// Out where the ray starts, by the sphere that lies before it, or else behind it: it must have come
    /// from some.
    fn at_once(&self, ray: &Ray) -> Option<SurfaceHit> {
        let forth = Ray {
            t_max: f32::INFINITY,
            ..*ray
        };
        let back = Ray::new(ray.at(ray.t_min), -ray.direction);
        let near = |ray: &Ray| self.spheres.nearest(ray);
        let hit = near(&forth).or_else(|| near(&back))?;
        let point = ray.at(ray.t_min);
        (ray.t_min < ray.t_max).then_some(SurfaceHit {
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

impl Surface for MediumSurface<'_> {
    const ONE_BODY: bool = true;

    fn crossing(&self, ray: &Ray, side: Side) -> Option<SurfaceHit> {
        match side {
            Side::Outside => self.entry(ray),
            Side::Inside => self.exit(ray),
        }
    }

    fn side_of(&self, point: Vec3) -> Side {
        if self.tree.contains(point) {
            Side::Inside
        } else {
            Side::Outside
        }
    }

    fn nearest(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.entry(ray)
    }

    /// Also for rays that start inside: what is met are the surfaces of spheres.
    fn occluded(&self, ray: &Ray) -> bool {
        self.spheres.occluded(ray)
    }

    fn occluded_packet(&self, packet: &RayPacket) -> u32 {
        self.spheres.occluded_packet(packet)
    }

    fn nearest_packet(&self, packet: &RayPacket) -> [Option<SurfaceHit>; PACKET_SIZE] {
        let mut hits = self.spheres.nearest_packet(packet);
        // Rays from outside all spheres enter the first that they meet, unless they only touch it.
        let mut start = None;
        for (hit, ray) in hits.iter_mut().zip(packet.rays()) {
            let begins = ray.at(ray.t_min);
            let is_inside = match start {
                Some((at, is_inside)) if at == begins => is_inside,
                _ => self.tree.contains(begins),
            };
            start = Some((begins, is_inside));
            let is_touched = |hit: &SurfaceHit| hit.normal.dot(ray.direction).abs() < TOUCHING;
            if is_inside || hit.as_ref().is_some_and(is_touched) {
                *hit = self.entry(&ray);
            }
        }
        hits
    }
}

#[cfg(test)]
#[path = "medium_tests.rs"]
mod tests;
