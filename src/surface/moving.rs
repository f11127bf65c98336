//! Spheres that move while the shutter is open, each a separate body, in a [`MovingTree`].

use glam::Vec3;

use super::shape::crossing_of_packet;
use super::spheres::intersections;
use super::{Intersection, Intersections, MaterialId, Shape, Side, TransmittanceProduct};
use crate::accel::Coherence;
use crate::accel::moving::{MovingHits, MovingTree};
use crate::math::{LANES, Lanes, Supported, first_lanes, lanes_in, set_lane3};
use crate::ray::{Ray, RayPacket};

/// The spheres of a moving tree as a shape. Each ray sees them at its own time.
#[derive(Debug, Clone, Copy)]
pub struct MovingSpheres<'a> {
    tree: &'a MovingTree,
    material: MaterialId,
    /// Index in the frame of the tree's particle 0.
    first: u32,
    /// Number of spheres of each particle.
    spheres: u32,
    simd: Supported,
}

impl<'a> MovingSpheres<'a> {
    /// The spheres of `tree`.
    pub fn new(tree: &'a MovingTree) -> Self {
        Self {
            tree,
            material: MaterialId::PARTICLES,
            first: 0,
            spheres: 1,
            simd: Supported::default(),
        }
    }

    /// Sets the material, and the index in the frame of the tree's first particle.
    #[must_use]
    pub fn of(self, material: MaterialId, first: u32) -> Self {
        Self {
            material,
            first,
            ..self
        }
    }

    /// Sets the number of spheres of each particle, one or more, which follow each other in the tree's numbers.
    #[must_use]
    pub fn of_particles_with(self, spheres: u32) -> Self {
        Self {
            spheres: spheres.max(1),
            ..self
        }
    }

    /// Index in the frame of the particle of a sphere of the tree.
    fn particle_of(&self, sphere: u32) -> u32 {
        self.first + sphere / self.spheres
    }
}

impl Shape for MovingSpheres<'_> {
    /// The intersection in the middle of the exposure.
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn material(&self) -> MaterialId {
        self.material
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
            let (center, radius): (Vec3, f32) = self.tree.sphere(found.slot[lane], rays.time[lane]);
            set_lane3(&mut centers, lane, center);
            radii[lane] = radius;
        }
        intersections(self.simd, rays, &found.t, &centers, &radii, hit_lanes, hits);
        // End the rays at their hits
        for lane in lanes_in(hit_lanes) {
            debug_assert_ne!(found.slot[lane], MovingHits::NO_SLOT);
            rays.t_max[lane] = found.t[lane];
            hits.particle[lane] = self.particle_of(self.tree.particle(found.slot[lane]));
            hits.material[lane] = self.material;
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
            let is_within = |t: &f32| *t >= rays.t_min[lane] && *t < rays.t_max[lane];
            self.tree
                .visit_chords(rays, lane, |particle, radius, ends| {
                    let cosine = 0.5 * (ends[1] - ends[0]) / radius;
                    let part = fresnel_transmittance(cosine, self.particle_of(particle));
                    ends.iter()
                        .filter(|t| is_within(t))
                        .all(|_| product.multiply(part))
                });
            transmittance[lane] = product.value();
        }
    }
}
