//! What the spheres of a tree belong to.

use super::{Intersections, MaterialId, TransmittanceProduct};
use spherule_tree::ray::RayPacket;

/// The material of the spheres of a tree, and the particles of the frame that they belong to.
#[derive(Debug, Clone, Copy)]
pub struct SphereOwners<'a> {
    pub(super) material: MaterialId,
    /// Index in the frame of the tree's particle 0.
    first: u32,
    /// Number of spheres of each particle, one after the other.
    spheres: u32,
    /// The particle of each sphere; empty if the numbers above say it.
    listed: &'a [u32],
}

impl<'a> SphereOwners<'a> {
    /// Each sphere is a particle of the frame, in its order.
    pub(super) const PARTICLES: Self = Self::new(MaterialId::PARTICLES, 0);

    /// Each sphere is a particle; `first` is the index in the frame of the tree's first one.
    pub const fn new(material: MaterialId, first: u32) -> Self {
        Self { material, first, spheres: 1, listed: &[] }
    }

    /// `particles` has the index in the frame of the particle of each sphere.
    pub const fn listed(material: MaterialId, particles: &'a [u32]) -> Self {
        Self { material, first: 0, spheres: 1, listed: particles }
    }

    /// Sets the number of spheres of each particle, one or more, which follow each other in the tree's numbers.
    #[must_use]
    pub fn with_spheres(self, spheres: u32) -> Self {
        Self { spheres: spheres.max(1), ..self }
    }

    /// Index in the frame of the particle of a sphere of the tree.
    #[inline(always)]
    pub(super) fn particle_of(&self, sphere: u32) -> u32 {
        if self.listed.is_empty() {
            self.first + sphere / self.spheres
        } else {
            self.listed[sphere as usize]
        }
    }

    /// Ends the ray in `lane` at distance `t`, at a sphere of the tree.
    #[inline(always)]
    pub(super) fn end_ray(
        &self,
        rays: &mut RayPacket,
        lane: usize,
        (t, sphere): (f32, u32),
        hits: &mut Intersections,
    ) {
        rays.t_max[lane] = t;
        hits.particle[lane] = self.particle_of(sphere);
        hits.material[lane] = self.material;
    }
}

/// Multiplies `product` by `part` for each of the two `ends` of a chord that the ray in `lane` reaches. Returns whether
/// light is left.
#[inline(always)]
pub(super) fn cross_chord(
    product: &mut TransmittanceProduct,
    part: f32,
    ends: [f32; 2],
    rays: &RayPacket,
    lane: usize,
) -> bool {
    let is_within = |t: &f32| *t >= rays.t_min[lane] && *t < rays.t_max[lane];
    ends.iter().filter(|t| is_within(t)).all(|_| product.multiply(part))
}
