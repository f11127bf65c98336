//! Foam and spray: particles with few neighbours, drawn as white drops that are not part of the body of the others.

use glam::Vec3;

use spherule_tree::accel::view::TreeView;

/// A particle with fewer neighbours is spray (Ihmsen et al. 2012, "Unified spray, foam and air bubbles for
/// particle-based fluids").
const ENOUGH_NEIGHBOURS: usize = 6;

/// Radius of a spherical drop of spray in radii of its particle, tuned by eye.
pub const DROP_RADIUS: f32 = 0.5;

/// Number of soft drops of a particle.
pub const SOFT_DROPS: u32 = 12;

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
pub fn soft_drop(id: u32, number: u32) -> SoftDrop {
    let random = |dimension: u32| {
        // Hash by Wellons, "lowbias32", 2018
        let mut bits =
            id.wrapping_mul(0x9e37_79b9) ^ (4 * number + dimension).wrapping_mul(0x85eb_ca6b);
        for _ in 0..2 {
            bits = (bits ^ bits >> 16).wrapping_mul(0x7feb_352d);
            bits = (bits ^ bits >> 15).wrapping_mul(0x846c_a68b);
            bits ^= bits >> 16;
        }
        (bits >> 8) as f32 / (1 << 24) as f32
    };
    let [least, greatest] = SOFT_RADII;
    let size = random(3);
    // Map a cube to a ball, and move the points towards its middle
    let [x, y, z] = [0, 1, 2].map(|axis| 2.0 * random(axis) - 1.0);
    let corner = Vec3::new(x, y, z);
    let offset = corner * (SOFT_SPREAD * corner.abs().max_element() / corner.length().max(1e-6));
    let reach = offset.length() / SOFT_SPREAD;
    SoftDrop { offset: reach * offset, radius: least + (greatest - least) * size * size }
}

#[cfg(test)]
#[path = "spray_tests.rs"]
mod tests;
