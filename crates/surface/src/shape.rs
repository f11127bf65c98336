//! The interface between surfaces and the renderer.

use glam::Vec3;

use super::{Intersection, Intersections, MaterialId, TransmittanceProduct};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{Lanes, lanes_in};
use spherule_tree::ray::{Ray, RayPacket};

/// Position of a ray relative to a connected body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Outside the body.
    Outside,
    /// Inside the body.
    Inside,
}

impl Side {
    /// The side after the ray has crossed the surface.
    #[must_use]
    #[inline]
    pub const fn other(self) -> Self {
        match self {
            Self::Outside => Self::Inside,
            Self::Inside => Self::Outside,
        }
    }

    /// The side of the ray in `lane`, from the mask of rays that are inside.
    #[inline(always)]
    pub(crate) const fn of_lane(inside: u32, lane: usize) -> Self {
        if inside >> lane & 1 == 1 { Self::Inside } else { Self::Outside }
    }
}

/// A surface that rays can hit. Results depend neither on threads nor on the accelerator.
///
/// A shape that implements only [`Self::crossing`], for one ray, is complete. Shapes with a faster method for packets
/// override [`Self::intersect`] and [`Self::occluded`].
pub trait Shape: Sync {
    /// The first intersection with a distance in `ray.t_min..ray.t_max`. Ties in distance go to the lower particle
    /// index. With a [connected](Self::is_connected) body, rays start on `side`; a ray that starts on the wrong side
    /// because of rounding crosses the surface immediately. All other shapes ignore `side`; the normal decides
    /// whether a ray enters or leaves.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection>;

    /// The first intersection of a ray that starts outside.
    fn nearest(&self, ray: &Ray) -> Option<Intersection> {
        self.crossing(ray, Side::Outside)
    }

    /// The material of the whole shape. [`MaterialId::PARTICLES`] is reserved for particles; all other shapes have a
    /// material of their own.
    fn material(&self) -> MaterialId {
        MaterialId::PARTICLES
    }

    /// Base colours of the parts of a shape, linear RGB, with the index [`Intersection::particle`]. A part without one
    /// has the colour of the material. The colours of [`MaterialId::PARTICLES`] come from attributes.
    fn colors(&self) -> &[Vec3] {
        &[]
    }

    /// Whether the shape bounds one connected body, so that rays are on one [`Side`] of it.
    fn is_connected(&self) -> bool {
        false
    }

    /// Whether rays may pass its parts by their opacity: separate bodies that have one.
    fn has_opacity(&self) -> bool {
        !self.is_connected()
    }

    /// The side of a connected body on which `point` is.
    fn side_of(&self, point: Vec3) -> Side {
        let _ = point;
        Side::Outside
    }

    /// Stores the nearest intersection of each ray in `hits` if it lies before the end of the ray, and ends the ray
    /// there. Rays of lanes in `inside` start inside a connected body. Rays that end before they start hit nothing.
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

    /// Bit mask of the rays of `lanes` that hit the shape between their ends.
    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let _ = coherence;
        lanes_in(lanes).fold(0, |hit_lanes, lane| {
            let hit = self.crossing(&rays.ray(lane), Side::Outside);
            hit_lanes | u32::from(hit.is_some()) << lane
        })
    }

    /// Transmittance along the rays of `lanes` through bodies that are not connected: the product of
    /// `fresnel_transmittance` over all crossings between their ends, entering and leaving. `fresnel_transmittance` gets
    /// the absolute cosine between ray and normal, and the particle.
    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        fresnel_transmittance: &dyn Fn(f32, u32) -> f32,
        transmittance: &mut Lanes,
    ) {
        for lane in lanes_in(lanes) {
            // Step from crossing to crossing until no light is left
            let mut product = TransmittanceProduct::default();
            let mut rest = rays.ray(lane);
            while let Some(hit) = self.crossing(&rest, Side::Outside) {
                let cosine = hit.normal.dot(rest.direction).abs();
                if !product.multiply(fresnel_transmittance(cosine, hit.particle)) {
                    break;
                }
                rest.t_min = hit.t + hit.offset;
            }
            transmittance[lane] = product.value();
        }
    }

    /// The shape as spheres whose entries are found in one traversal, if it can do that.
    fn sphere_entries(&self) -> Option<&dyn SphereEntries> {
        None
    }

    /// The particle of an intersection, for shapes that need an additional search to find it.
    fn particle_at(&self, hit: &Intersection) -> u32 {
        hit.particle
    }

    /// Calls `each` as [`Self::blend`] does for a `point` inside a connected body, as the body is at `time`, from -1/2 to
    /// 1/2. Does not call it if no particle is there.
    fn blend_at(&self, point: Vec3, time: f32, each: &mut dyn FnMut(u32, f32)) {
        let _ = (point, time, each);
    }

    /// Calls `each` with the particles that contribute attributes to a point on the surface, and with positive
    /// weights that need not be normalised; calls it at least once.
    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        each(hit.particle, 1.0);
    }
}

/// The point where a ray enters a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereEntry {
    /// Distance along the ray.
    pub t: f32,
    /// Index of the particle in the frame.
    pub particle: u32,
    /// Slot in tree order.
    pub slot: u32,
}

/// Separate spheres that find all of those that rays enter in one traversal.
pub trait SphereEntries {
    /// Calls `visit` with a lane and an entry for each sphere that a ray in `lanes` enters between its ends, in any
    /// order but nearer boxes first. `visit` returns the distance behind which further spheres do not matter to the
    /// ray, or None if that stays the same: at most the current one, or a negative one to end the ray.
    fn visit_entries(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: &mut dyn FnMut(usize, SphereEntry) -> Option<f32>,
    );

    /// The intersection of a ray with the surface at an entry.
    fn intersection(&self, ray: &Ray, entry: &SphereEntry) -> Intersection;
}

/// Spheres that can be cut.
pub trait CutShape: Shape {
    /// Calls `visit` with the ray, the particle, the radius, and the distances of both intersections for every sphere
    /// that contains a point of the rays in `lanes` between their ends, and for some others.
    fn visit_chords(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: &mut dyn FnMut(usize, u32, f32, [f32; 2]),
    );
}

/// [`Shape::intersect`] in terms of [`Shape::crossing`].
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

/// [`Shape::crossing`] in terms of [`Shape::intersect`].
pub(super) fn crossing_of_packet(shape: &dyn Shape, ray: &Ray, side: Side) -> Option<Intersection> {
    let mut rays = RayPacket::default();
    rays.push(ray);
    let mut hits = Intersections::default();
    let inside = u32::from(side == Side::Inside);
    shape.intersect(&mut rays, Coherence::Incoherent, inside, &mut hits);
    (hits.mask == 1).then(|| hits.get(0))
}
