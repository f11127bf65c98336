//! What rays meet. The renderer knows only [`Surface`]: a hit is a distance, a normal, and a
//! particle to take attributes from, whatever made it (spheres now; connected media and smooth
//! isosurfaces have room here).

use glam::Vec3;

use crate::accel::Coherence;
use crate::math::lanes_in;
use crate::ray::{PACKET_SIZE, Ray, RayPacket};

mod dimming;
pub mod field;
mod gradient;
mod intersections;
pub mod medium;
mod neighbours;
mod normals;
mod pca;
mod settings;
pub mod smooth;
pub mod spheres;
pub mod spray;

pub(crate) use dimming::Dimming;
pub use gradient::GradientNormals;
pub use intersections::{Intersections, MaterialId};
pub use normals::ShadingNormals;
pub use pca::PcaNormals;
pub use settings::{NormalKind, SurfaceKind, SurfaceSettings};

/// One meeting of a ray with the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceHit {
    /// Distance along the ray.
    pub t: f32,
    /// The point, put back onto the surface so that it is exact to a few ulps.
    pub point: Vec3,
    /// Outward unit normal; the ray enters the body if it points against the ray.
    pub normal: Vec3,
    /// Unit normal to shade by, seen from the same side as `normal`; `normal` where nothing smoother is known.
    pub shading: Vec3,
    /// Length along `shading` by which rays to lights start higher, so that what it smooths over casts no
    /// shadow on itself; 0 where it smooths over nothing.
    pub lift: f32,
    /// Index of the particle in the frame.
    pub particle: u32,
    /// Length to step along the normal (either side) so that the next ray does not meet the same
    /// place again.
    pub offset: f32,
    /// Where to step from: `point`, unless that lies on a finer surface than rays meet.
    pub anchor: Vec3,
    /// What is met.
    pub substance: Substance,
}

/// What a surface is the surface of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Substance {
    /// What the scene's material says.
    #[default]
    Body,
    /// Foam and spray beside a body: small, white, opaque.
    Spray,
}

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

/// Anything a ray can meet. Answers do not depend on threads or on the accelerator.
pub trait Surface: Sync {
    /// Whether all of it bounds one body of one medium, so that rays are on one [`Side`] of it and ask for
    /// [`Surface::crossing`]. Else each meeting tells by its normal where the ray goes.
    const ONE_BODY: bool = false;

    /// The first place where a ray that starts on `side` of one body comes to the other side, or meets
    /// spray; [`Side::Outside`] is what [`Surface::nearest`] takes for granted. A ray that starts on the
    /// wrong side by rounding crosses at once.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<SurfaceHit> {
        let _ = side;
        self.nearest(ray)
    }

    /// Where `point` is of one body.
    fn side_of(&self, point: Vec3) -> Side {
        let _ = point;
        Side::Outside
    }

    /// The particle that a hit belongs to, where finding it takes more than finding the hit.
    fn particle_at(&self, hit: &SurfaceHit) -> u32 {
        hit.particle
    }

    /// Gives `each` the particles whose attributes are those of a place on the surface, with positive
    /// weights of any sum; at least one.
    fn blend(&self, hit: &SurfaceHit, each: &mut dyn FnMut(u32, f32)) {
        each(hit.particle, 1.0);
    }

    /// The nearest meeting with distance in `ray.t_min..ray.t_max`; equal distances go to the
    /// lower particle index.
    fn nearest(&self, ray: &Ray) -> Option<SurfaceHit>;

    /// Whether anything at all lies in `ray.t_min..ray.t_max`.
    fn occluded(&self, ray: &Ray) -> bool;

    /// How much of a light's radiance comes along `ray` through transmissive bodies: the product over
    /// all meetings in `ray.t_min..ray.t_max`, entering and leaving, of what `kept` makes of the
    /// absolute cosine between ray and normal.
    ///
    /// What is not one body must say itself where its meetings are; one body goes from side to side.
    fn transmittance(&self, ray: &Ray, kept: impl Fn(f32) -> f32) -> f32 {
        let mut dimming = Dimming::default();
        let mut side = self.side_of(ray.at(ray.t_min));
        let mut rest = *ray;
        while let Some(hit) = self.crossing(&rest, side) {
            if !dimming.by(kept(hit.normal.dot(ray.direction).abs())) {
                break;
            }
            rest.t_min = hit.t + hit.offset;
            side = side.other();
        }
        dimming.product()
    }

    /// [`Surface::nearest`] of each ray, the same to the bit. For rays that are close together.
    fn nearest_packet(&self, packet: &RayPacket) -> [Option<SurfaceHit>; PACKET_SIZE] {
        let mut hits = [None; PACKET_SIZE];
        for (hit, ray) in hits.iter_mut().zip(packet.rays()) {
            *hit = self.nearest(&ray);
        }
        hits
    }

    /// [`Surface::occluded`] of each ray: a bit for each lane.
    fn occluded_packet(&self, packet: &RayPacket) -> u32 {
        let bit = |(lane, ray): (u32, Ray)| u32::from(self.occluded(&ray)) << lane;
        (0..).zip(packet.rays()).map(bit).sum()
    }

    /// Puts the nearest intersection of each ray into `hits`, where one lies before the ray's end, and ends the ray
    /// there. Rays of lanes in `inside` start inside of one body.
    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        let mut found = match coherence {
            Coherence::Coherent if inside == 0 => self.nearest_packet(rays),
            _ => [None; PACKET_SIZE],
        };
        if coherence == Coherence::Incoherent || inside != 0 {
            for (lane, ray) in rays.rays().enumerate() {
                let side = Side::of_lane(inside, lane);
                found[lane] = self.crossing(&ray, side);
            }
        }
        for (lane, hit) in found.iter().enumerate() {
            if let Some(hit) = hit {
                hits.set(lane, hit);
                rays.t_max[lane] = hit.t;
            }
        }
    }

    /// [`Surface::occluded`] of the rays in `lanes`: a bit for each.
    fn occluded_lanes(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        if coherence == Coherence::Coherent && lanes.count_ones() as usize == rays.len() {
            return self.occluded_packet(rays);
        }
        lanes_in(lanes).fold(0, |met, lane| {
            met | u32::from(self.occluded(&rays.ray(lane))) << lane
        })
    }
}
