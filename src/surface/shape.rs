//! The interface between what rays meet and what becomes of them there.

use super::{Dimming, Intersection, Intersections, MaterialId};
use crate::accel::Coherence;
use crate::math::{Lanes, lanes_in};
use crate::ray::{Ray, RayPacket};

/// Where a ray is that meets one connected body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// In the open.
    Outside,
    /// In the body's medium.
    Inside,
}

impl Side {
    /// Where a ray is after it crossed the surface.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Outside => Self::Inside,
            Self::Inside => Self::Outside,
        }
    }

    /// Where the ray in `lane` is, by a mask of those inside.
    #[inline(always)]
    pub(crate) const fn of_lane(inside: u32, lane: usize) -> Self {
        if inside >> lane & 1 == 1 {
            Self::Inside
        } else {
            Self::Outside
        }
    }
}

/// Anything that rays meet. Answers depend neither on threads nor on the accelerator.
///
/// A shape that can answer for one ray, by [`Self::crossing`], is whole; one that can do better for packets says so in
/// [`Self::intersect`] and [`Self::occluded`].
pub trait Shape: Sync {
    /// The first intersection with distance in `ray.t_min..ray.t_max`; equal distances go to the lower particle index.
    /// Rays of a [connected](Self::is_connected) body start on `side` of it, and one that starts on the wrong side by
    /// rounding crosses at once. Any other shape tells by the normal where a ray goes, and has no side.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection>;

    /// The first intersection of a ray that starts outside.
    fn nearest(&self, ray: &Ray) -> Option<Intersection> {
        self.crossing(ray, Side::Outside)
    }

    /// What all of it is made of. [`MaterialId::PARTICLES`] is for the particles alone: any other shape has a material
    /// of its own.
    fn material(&self) -> MaterialId {
        MaterialId::PARTICLES
    }

    /// Whether it bounds one body of one medium, so that rays are on one [`Side`] of it.
    fn is_connected(&self) -> bool {
        false
    }

    /// Where a place is of a connected body.
    fn side_of(&self, point: glam::Vec3) -> Side {
        let _ = point;
        Side::Outside
    }

    /// Puts the nearest intersection of each ray into `hits`, where one lies before the ray's end, and ends the ray
    /// there. Rays of lanes in `inside` start inside of a connected body. Rays that end before they start meet nothing.
    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        let _ = coherence;
        intersect_one_by_one(self, rays, inside, hits);
    }

    /// The rays of `lanes` that meet it anywhere between their ends: a bit for each.
    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let _ = coherence;
        lanes_in(lanes).fold(0, |met, lane| {
            let hit = self.crossing(&rays.ray(lane), Side::Outside);
            met | u32::from(hit.is_some()) << lane
        })
    }

    /// What is left of light along the rays of `lanes` through bodies that are not connected: the product over all
    /// crossings between their ends, entering and leaving, of what `passed` makes of the absolute cosine between ray and
    /// normal.
    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        passed: &dyn Fn(f32) -> f32,
        kept: &mut Lanes,
    ) {
        for lane in lanes_in(lanes) {
            let mut dimming = Dimming::default();
            let mut rest = rays.ray(lane);
            while let Some(hit) = self.crossing(&rest, Side::Outside) {
                if !dimming.by(passed(hit.normal.dot(rest.direction).abs())) {
                    break;
                }
                rest.t_min = hit.t + hit.offset;
            }
            kept[lane] = dimming.product();
        }
    }

    /// The particle of an intersection, where finding it takes more than finding the intersection.
    fn particle_at(&self, hit: &Intersection) -> u32 {
        hit.particle
    }

    /// Gives `each` the particles whose attributes are those of a place on the surface, with positive weights of any
    /// sum; at least one.
    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        each(hit.particle, 1.0);
    }
}

/// [`Shape::intersect`] by [`Shape::crossing`].
pub(super) fn intersect_one_by_one<S: Shape + ?Sized>(
    shape: &S,
    rays: &mut RayPacket,
    inside: u32,
    hits: &mut Intersections,
) {
    for lane in 0..rays.len() {
        let ray = rays.ray(lane);
        if ray.t_max > ray.t_min
            && let Some(hit) = shape.crossing(&ray, Side::of_lane(inside, lane))
        {
            hits.end_ray(rays, lane, &hit, shape.material());
        }
    }
}

/// [`Shape::crossing`] by [`Shape::intersect`].
pub(super) fn crossing_of_packet(shape: &dyn Shape, ray: &Ray, side: Side) -> Option<Intersection> {
    let mut rays = RayPacket::default();
    rays.push(ray);
    let mut hits = Intersections::default();
    let inside = u32::from(side == Side::Inside);
    shape.intersect(&mut rays, Coherence::Incoherent, inside, &mut hits);
    (hits.mask == 1).then(|| hits.get(0))
}
