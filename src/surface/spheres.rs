//! Opaque or transmissive spheres, each a body of its own, found through a [`TreeView`].

use std::cell::RefCell;

use glam::Vec3;

use super::{Dimming, ShadingNormals, Substance, Surface, SurfaceHit};
use crate::accel::traverse::{TreeCrossing, TreeHit};
use crate::accel::view::TreeView;
use crate::ray::{PACKET_SIZE, Ray, RayPacket};

/// Step off the surface as a fraction of the radius. Large enough for the rounding of a point that
/// was put back onto its sphere, small enough not to be seen.
const OFFSET_OF_RADIUS: f32 = 1e-4;
/// Step off the surface in units of the rounding of the largest coordinate involved.
const OFFSET_OF_ROUNDING: f32 = 8.0 * f32::EPSILON;

/// The spheres of a tree.
#[derive(Debug, Clone, Copy)]
pub struct SphereSurface<'a> {
    tree: TreeView<'a>,
    normals: ShadingNormals,
}

impl<'a> SphereSurface<'a> {
    /// The spheres of `tree`.
    pub fn new(tree: TreeView<'a>) -> Self {
        Self {
            tree,
            normals: ShadingNormals::Sphere,
        }
    }

    /// Shaded by these normals.
    #[must_use]
    pub fn shaded_by(self, normals: ShadingNormals) -> Self {
        Self { normals, ..self }
    }

    #[inline]
    fn surface_hit(&self, ray: &Ray, hit: TreeHit) -> SurfaceHit {
        sphere_hit(&self.tree, ray, hit, &self.normals)
    }
}

/// What a ray meets at `hit`, a sphere of `tree`.
#[inline]
pub(super) fn sphere_hit(
    tree: &TreeView,
    ray: &Ray,
    hit: TreeHit,
    normals: &ShadingNormals,
) -> SurfaceHit {
    let (center, radius) = tree.sphere(hit.slot);
    let normal = outward(ray.at(hit.t) - center, radius, ray.direction);
    let point = center + normal * radius;
    let largest = point
        .abs()
        .max_element()
        .max(ray.origin.abs().max_element());
    let met = SurfaceHit {
        t: hit.t,
        point,
        normal,
        shading: normal,
        lift: 0.0,
        particle: tree.particle(hit.slot),
        anchor: point,
        substance: Substance::Body,
        offset: (OFFSET_OF_RADIUS * radius).max(OFFSET_OF_ROUNDING * largest),
    };
    normals.shade(tree, ray, met, radius)
}

impl Surface for SphereSurface<'_> {
    #[inline]
    fn nearest(&self, ray: &Ray) -> Option<SurfaceHit> {
        Some(self.surface_hit(ray, self.tree.nearest(ray)?))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.tree.any_hit(ray)
    }

    fn nearest_packet(&self, packet: &RayPacket) -> [Option<SurfaceHit>; PACKET_SIZE] {
        let hits = self.tree.nearest_packet(packet);
        std::array::from_fn(|lane| {
            let hit = hits[lane]?;
            Some(self.surface_hit(&packet.ray(lane), hit))
        })
    }

    fn occluded_packet(&self, packet: &RayPacket) -> u32 {
        self.tree.any_hit_packet(packet)
    }

    fn transmittance(&self, ray: &Ray, kept: impl Fn(f32) -> f32) -> f32 {
        let mut dimming = Dimming::default();
        if self.tree.has_copies() {
            self.each_crossing_once(ray, |crossing| {
                dimming.by(kept(self.cosine(ray, &crossing)))
            });
        } else {
            self.tree.visit_crossings(ray, |crossing| {
                dimming.by(kept(self.cosine(ray, &crossing)))
            });
        }
        dimming.product()
    }
}

impl SphereSurface<'_> {
    /// Absolute cosine between the ray and the normal where it passes through a sphere.
    fn cosine(&self, ray: &Ray, crossing: &TreeCrossing) -> f32 {
        let (center, radius) = self.tree.sphere(crossing.slot);
        let normal = outward(ray.at(crossing.t) - center, radius, ray.direction);
        normal.dot(ray.direction).abs()
    }

    /// Crossings where one may be found several times: all of them must be there first.
    fn each_crossing_once(&self, ray: &Ray, mut visit: impl FnMut(TreeCrossing) -> bool) {
        thread_local! {
            /// Shadow rays of a thread follow one another: one buffer serves them all.
            static FOUND: RefCell<Vec<TreeCrossing>> = const { RefCell::new(Vec::new()) };
        }
        FOUND.with_borrow_mut(|found| {
            self.tree.crossings(ray, found);
            let _is_dark = !found.iter().all(|crossing| visit(*crossing));
        });
    }
}

/// Unit vector along `from_center`; against the ray for a sphere too small to have a direction.
fn outward(from_center: Vec3, radius: f32, direction: Vec3) -> Vec3 {
    if radius > 0.0 {
        from_center.try_normalize().unwrap_or(-direction)
    } else {
        -direction
    }
}
