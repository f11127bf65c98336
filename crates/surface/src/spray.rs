//! Foam and spray: particles with few neighbours, drawn as white drops that are not part of the body of the others.

use glam::Vec3;
use rayon::prelude::*;

use super::field::FieldParticles;
use super::field::bins::Bins;
use spherule_tree::accel::view::TreeView;

/// A particle with fewer neighbours is spray (Ihmsen et al. 2012, "Unified spray, foam and air bubbles for
/// particle-based fluids").
const ENOUGH_NEIGHBOURS: usize = 6;

/// Radius of a spherical drop of spray in radii of its particle, tuned by eye.
pub const DROP_RADIUS: f32 = 0.5;

/// Number of soft drops of a particle.
pub const SOFT_DROPS: u32 = 12;

/// Bytes of a soft drop before it is in a tree: centre and radius.
pub const SOFT_DROP_BYTES: u64 = 16;

/// Least and greatest radius of a soft drop in radii of its particle, tuned by eye. A soft drop is hardly visible near
/// its silhouette, so it looks smaller than a sphere.
const SOFT_RADII: [f32; 2] = [0.1, 0.5];

/// Greatest distance of a soft drop from its particle in radii of the particle, tuned by eye.
const SOFT_SPREAD: f32 = 1.4;

/// Indices of the spray particles of `tree` in ascending order: those with few others within `support` times their
/// radius. The tree must have been built with indices.
#[must_use]
pub fn spray_of(tree: &TreeView, support: f32) -> Vec<u32> {
    tree.isolated(support, ENOUGH_NEIGHBOURS)
}

/// The `centers` without those of spray, in another order. `reach` is the support times the radius of all particles.
pub(super) fn without_spray(centers: &[Vec3], reach: f32) -> Vec<Vec3> {
    let field = FieldParticles::sorted(centers, reach, false);
    let bins = field.bins();
    let is_body = |place: &usize| has_neighbours(bins, *place, reach);
    let places = (0..bins.points().len()).into_par_iter().with_min_len(1 << 10);
    places.filter(is_body).map(|place| bins.points()[place]).collect()
}

/// Whether the particle at `place` in `bins` of the size `reach` has enough others within that distance.
fn has_neighbours(bins: &Bins, place: usize, reach: f32) -> bool {
    let point = bins.points()[place];
    let [x, y, z] = bins.cell_of(point);
    let is_near = |other: &usize| {
        *other != place && bins.points()[*other].distance_squared(point) <= reach * reach
    };
    let mut count = 0;
    // Its own row of bins first
    for z in [z, z - 1, z + 1] {
        for y in [y, y - 1, y + 1] {
            let run = bins.run(z, y, x - 1..x + 2);
            let near = bins.particles_in(run).filter(is_near);
            count += near.take(ENOUGH_NEIGHBOURS - count).count();
            if count >= ENOUGH_NEIGHBOURS {
                return true;
            }
        }
    }
    false
}

/// A soft drop of a particle, in radii of the particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftDrop {
    /// Position relative to that of the particle.
    pub offset: Vec3,
    /// Radius.
    pub radius: f32,
}

/// The soft drop `number` of the particle `id`. There are more small drops than large ones, and more near the particle
/// than far from it.
#[must_use]
#[inline]
pub fn soft_drop(id: u32, number: u32) -> SoftDrop {
    let random = |dimension: u32| random(id, 4 * number + dimension);
    let [least, greatest] = SOFT_RADII;
    let size = random(3);
    // Move the points of a ball towards its middle
    let offset = point_in_ball([0, 1, 2].map(random), SOFT_SPREAD);
    let reach = offset.length() / SOFT_SPREAD;
    SoftDrop { offset: reach * offset, radius: least + (greatest - least) * size * size }
}

/// The random number `dimension` of the particle `id`, from 0 to below 1: the same in all frames.
#[inline]
pub(super) fn random(id: u32, dimension: u32) -> f32 {
    // Hash by Wellons, "lowbias32", 2018
    let mut bits = id.wrapping_mul(0x9e37_79b9) ^ dimension.wrapping_mul(0x85eb_ca6b);
    for _ in 0..2 {
        bits = (bits ^ bits >> 16).wrapping_mul(0x7feb_352d);
        bits = (bits ^ bits >> 15).wrapping_mul(0x846c_a68b);
        bits ^= bits >> 16;
    }
    (bits >> 8) as f32 / (1 << 24) as f32
}

/// The point of a ball of `radius` around the origin that three numbers from 0 to 1 lead to, by a map from a cube.
#[inline]
pub(super) fn point_in_ball(u: [f32; 3], radius: f32) -> Vec3 {
    let corner = Vec3::from(u.map(|u| 2.0 * u - 1.0));
    corner * (radius * corner.abs().max_element() / corner.length().max(1e-6))
}

#[cfg(test)]
#[path = "spray_tests.rs"]
mod tests;
