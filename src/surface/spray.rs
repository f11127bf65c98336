//! Foam and spray: particles with few neighbours, drawn as small white spheres beside the body that the
//! others make.

use crate::accel::view::TreeView;

/// A particle with fewer neighbours is spray (Ihmsen et al. 2012, "Unified spray, foam and air bubbles for
/// particle-based fluids").
const ENOUGH_NEIGHBOURS: usize = 6;

/// Radius of a drop of spray in radii of its particle: by eye.
pub const DROP_RADIUS: f32 = 0.5;

/// The particles of `tree` that are spray, in order: those with few others within `support` times their radius.
/// The tree must know its particles' indices.
#[must_use]
pub fn spray_of(tree: &TreeView, support: f32) -> Vec<u32> {
    tree.isolated(support, ENOUGH_NEIGHBOURS)
}

#[cfg(test)]
#[path = "spray_tests.rs"]
mod tests;
