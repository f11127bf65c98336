//! Spheres that move while the shutter is open, each a separate body, in a [`MovingTree`].

use super::owners::{SphereOwners, cross_chord};
use super::shape::{CutShape, crossing_of_packet};
use super::spheres::intersections;
use super::{Intersection, Intersections, MaterialId, Shape, Side, TransmittanceProduct};
use spherule_tree::accel::Coherence;
use spherule_tree::accel::moving::MovingTree;
use spherule_tree::math::{LANES, Lanes, Supported, first_lanes, lanes_in, set_lane3};
use spherule_tree::ray::{Ray, RayPacket};

/// The spheres of a moving tree as a shape. Each ray sees them at its own time.
#[derive(Debug, Clone, Copy)]
pub struct MovingSpheres<'a> {
    tree: &'a MovingTree,
    owners: SphereOwners<'a>,
    simd: Supported,
}

impl<'a> MovingSpheres<'a> {
    /// The spheres of `tree`.
    pub fn new(tree: &'a MovingTree) -> Self {
        Self { tree, owners: SphereOwners::PARTICLES, simd: Supported::default() }
    }

    /// Sets what the spheres belong to.
    #[must_use]
    pub fn of(self, owners: SphereOwners<'a>) -> Self {
        Self { owners, ..self }
    }
}

impl Shape for MovingSpheres<'_> {
    /// The intersection in the middle of the exposure.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        self.owners.material
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        _coherence: Coherence,
        _inside: u32,
        hits: &mut Intersections,
    ) {
        // Find the nearest spheres
        let found = self.tree.nearest(rays, first_lanes(rays.len()));
        let hit_lanes = found.mask();
        if hit_lanes == 0 {
            return;
        }
        // Compute points and normals at the times of the rays
        let mut centers = [[0.0; LANES]; 3];
        let mut radii = [1.0; LANES];
        for lane in lanes_in(hit_lanes) {
            let (center, radius) = self.tree.sphere(found.slot[lane], rays.time[lane]);
            set_lane3(&mut centers, lane, center);
            radii[lane] = radius;
        }
        intersections(self.simd, rays, &found.t, &centers, &radii, hit_lanes, hits);
        // End the rays at their hits
        for lane in lanes_in(hit_lanes) {
            let sphere = self.tree.particle(found.slot[lane]);
            (self.owners).end_ray(rays, lane, (found.t[lane], sphere), hits);
        }
        hits.mask |= hit_lanes;
    }

    fn occluded(&self, rays: &RayPacket, _coherence: Coherence, lanes: u32) -> u32 {
        self.tree.occluded(rays, lanes)
    }

    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        fresnel_transmittance: &dyn Fn(f32, u32) -> f32,
        transmittance: &mut Lanes,
    ) {
        for lane in lanes_in(lanes) {
            let mut product = TransmittanceProduct::default();
            self.tree.visit_chords(rays, lane, |sphere, radius, ends| {
                let cosine = 0.5 * (ends[1] - ends[0]) / radius;
                let part = fresnel_transmittance(cosine, self.owners.particle_of(sphere));
                cross_chord(&mut product, part, ends, rays, lane)
            });
            transmittance[lane] = product.value();
        }
    }
}

impl CutShape for MovingSpheres<'_> {
    fn visit_chords(
        &self,
        rays: &RayPacket,
        lanes: u32,
        visit: &mut dyn FnMut(usize, u32, f32, [f32; 2]),
    ) {
        for lane in lanes_in(lanes) {
            self.tree.visit_chords(rays, lane, |sphere, radius, ends| {
                visit(lane, self.owners.particle_of(sphere), radius, ends);
                true
            });
        }
    }
}
