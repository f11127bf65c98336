//! Foam and spray: particles with few neighbours, drawn as small white spheres that are not part of the body of the
//! others.

use crate::accel::view::TreeView;

/// A particle with fewer neighbours is spray (Ihmsen et al. 2012, "Unified spray, foam and air bubbles for
/// particle-based fluids").
const ENOUGH_NEIGHBOURS: usize = 6;

/// Radius of a drop of spray in radii of its particle, tuned by eye.
pub const DROP_RADIUS: f32 = 0.5;

/// Indices of the spray particles of `tree` in ascending order: those with few others within `support` times their
/// radius. The tree must have been built with indices.
#[must_use]
pub fn spray_of(tree: &TreeView, support: f32) -> Vec<u32> {
    tree.isolated(support, ENOUGH_NEIGHBOURS)
}

#[cfg(test)]
#[path = "spray_tests.rs"]
mod tests;
