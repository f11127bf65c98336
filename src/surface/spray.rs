//! Foam and spray: particles with few neighbours, drawn as small white spheres beside the body that the
//! others make.

use glam::Vec3;

use super::spheres::SphereSurface;
use super::{Intersections, MaterialId, Side, Substance, Surface, SurfaceHit};
use crate::accel::Coherence;
use crate::accel::view::TreeView;
use crate::math::lanes_in;
use crate::ray::{PACKET_SIZE, Ray, RayPacket};

/// A particle with fewer neighbours is spray (Ihmsen et al. 2012, "Unified spray, foam and air bubbles for
/// particle-based fluids").
const ENOUGH_NEIGHBOURS: usize = 6;

/// Radius of a drop of spray in radii of its particle: by eye.
pub const DROP_RADIUS: f32 = 0.5;

/// The particles of `tree` that are spray, in order: those with few others within `support` times their radius.
/// The tree must know its particles' indices.
#[must_use]
pub fn spray_of(tree: &TreeView, support: f32) -> Vec<u32> {
    tree.lonely(support, ENOUGH_NEIGHBOURS)
}

/// Drops of spray, whose particles come after those of the body.
#[derive(Debug, Clone, Copy)]
pub struct Drops<'a> {
    spheres: SphereSurface<'a>,
    first: u32,
}

impl<'a> Drops<'a> {
    /// The spheres of `tree`, of which the first is particle `first` of the frame.
    pub fn new(tree: TreeView<'a>, first: u32) -> Self {
        Self {
            spheres: SphereSurface::new(tree),
            first,
        }
    }

    fn drop(&self, hit: SurfaceHit) -> SurfaceHit {
        SurfaceHit {
            particle: self.first + hit.particle,
            substance: Substance::Spray,
            ..hit
        }
    }

    fn nearest(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.spheres.nearest(ray).map(|hit| self.drop(hit))
    }
}

/// A body of any kind with the spray beside it, if there is any.
#[derive(Debug, Clone, Copy)]
pub struct WithSpray<'a, S> {
    body: S,
    spray: Option<Drops<'a>>,
}

impl<'a, S: Surface> WithSpray<'a, S> {
    /// `spray` beside `body`.
    pub fn new(body: S, spray: Option<Drops<'a>>) -> Self {
        Self { body, spray }
    }

    /// `hit`, or a drop that `ray` meets before.
    fn or_drop(&self, ray: &Ray, hit: Option<SurfaceHit>) -> Option<SurfaceHit> {
        let Some(spray) = &self.spray else {
            return hit;
        };
        let t_max = hit.map_or(ray.t_max, |hit| hit.t);
        spray.nearest(&Ray { t_max, ..*ray }).or(hit)
    }
}

impl<S: Surface> Surface for WithSpray<'_, S> {
    const ONE_BODY: bool = S::ONE_BODY;

    fn crossing(&self, ray: &Ray, side: Side) -> Option<SurfaceHit> {
        self.or_drop(ray, self.body.crossing(ray, side))
    }

    fn side_of(&self, point: Vec3) -> Side {
        self.body.side_of(point)
    }

    fn particle_at(&self, hit: &SurfaceHit) -> u32 {
        match hit.substance {
            Substance::Body => self.body.particle_at(hit),
            Substance::Spray => hit.particle,
        }
    }

    fn blend(&self, hit: &SurfaceHit, each: &mut dyn FnMut(u32, f32)) {
        match hit.substance {
            Substance::Body => self.body.blend(hit, each),
            Substance::Spray => each(hit.particle, 1.0),
        }
    }

    fn nearest(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.or_drop(ray, self.body.nearest(ray))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let spray = self.spray.as_ref();
        self.body.occluded(ray) || spray.is_some_and(|spray| spray.spheres.occluded(ray))
    }

    fn transmittance(&self, ray: &Ray, kept: impl Fn(f32) -> f32) -> f32 {
        match &self.spray {
            Some(spray) if spray.spheres.occluded(ray) => 0.0,
            _ => self.body.transmittance(ray, kept),
        }
    }

    fn nearest_packet(&self, packet: &RayPacket) -> [Option<SurfaceHit>; PACKET_SIZE] {
        let mut hits = self.body.nearest_packet(packet);
        let Some(spray) = &self.spray else {
            return hits;
        };
        let mut rest = *packet;
        for (t_max, hit) in rest.t_max.iter_mut().zip(&hits) {
            *t_max = hit.map_or(*t_max, |hit| hit.t);
        }
        let drops = spray.spheres.nearest_packet(&rest);
        for (hit, drop) in hits.iter_mut().zip(drops) {
            *hit = drop.map(|drop| spray.drop(drop)).or(*hit);
        }
        hits
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        self.body.intersect(rays, coherence, inside, hits);
        let Some(spray) = &self.spray else {
            return;
        };
        let body = hits.mask;
        hits.mask = 0;
        spray.spheres.intersect(rays, coherence, 0, hits);
        for lane in lanes_in(hits.mask) {
            hits.particle[lane] += spray.first;
            hits.material[lane] = MaterialId::SPRAY;
        }
        hits.mask |= body;
    }

    fn occluded_lanes(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        let body = self.body.occluded_lanes(rays, coherence, lanes);
        let rest = lanes & !body;
        match &self.spray {
            Some(spray) if rest != 0 => body | spray.spheres.occluded_lanes(rays, coherence, rest),
            _ => body,
        }
    }

    fn occluded_packet(&self, packet: &RayPacket) -> u32 {
        let body = self.body.occluded_packet(packet);
        let spray = self.spray.as_ref();
        body | spray.map_or(0, |spray| spray.spheres.occluded_packet(packet))
    }
}

#[cfg(test)]
#[path = "spray_tests.rs"]
mod tests;
