//! A connected body of some of the particles of a frame, with a material of its own.

use glam::Vec3;

use super::{Intersection, Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::lanes_in;
use spherule_tree::ray::{Ray, RayPacket};

/// A body over particles that follow each other in the frame.
pub struct OwnedBody<'a> {
    body: Box<dyn Shape + 'a>,
    material: MaterialId,
    /// Index in the frame of the body's particle 0.
    first: u32,
}

impl<'a> OwnedBody<'a> {
    /// A `body` of this `material`; `first` is the index in the frame of its particle 0.
    pub fn new(body: Box<dyn Shape + 'a>, material: MaterialId, first: u32) -> Self {
        Self { body, material, first }
    }

    /// An intersection as the body has it.
    fn own(&self, hit: &Intersection) -> Intersection {
        Intersection { particle: hit.particle.saturating_sub(self.first), ..*hit }
    }
}

impl Shape for OwnedBody<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        let hit = self.body.crossing(ray, side)?;
        Some(Intersection { particle: self.first + hit.particle, ..hit })
    }

    fn material(&self) -> MaterialId {
        self.material
    }

    fn is_connected(&self) -> bool {
        self.body.is_connected()
    }

    fn side_of(&self, point: Vec3) -> Side {
        self.body.side_of(point)
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        // Rays that the body ends are shorter than before
        let before = rays.t_max;
        self.body.intersect(rays, coherence, inside, hits);
        for lane in lanes_in(hits.mask) {
            if rays.t_max[lane] < before[lane] {
                hits.material[lane] = self.material;
                hits.particle[lane] += self.first;
            }
        }
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        self.body.occluded(rays, coherence, lanes)
    }

    fn particle_at(&self, hit: &Intersection) -> u32 {
        self.first + self.body.particle_at(&self.own(hit))
    }

    fn blend_at(&self, point: Vec3, time: f32, each: &mut dyn FnMut(u32, f32)) {
        let first = self.first;
        self.body.blend_at(point, time, &mut |particle, weight| each(first + particle, weight));
    }

    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        let first = self.first;
        self.body.blend(&self.own(hit), &mut |particle, weight| each(first + particle, weight));
    }
}
