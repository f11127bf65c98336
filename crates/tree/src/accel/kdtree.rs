//! `kdtree`: a k-d tree (Bentley 1975), split at the median of the widest axis down to one block, and folded into
//! implicit 8-wide levels. It is the fastest structure to trace.
//!
//! The build only orders the particles (`order/kd` in `spherule-formats`); the positions of nodes follow by arithmetic.

use crate::order::kd;

use super::levels::TopLevels;
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure};

/// Builds a tree over `spheres` in the memory of `tree`.
pub(super) fn build(
    tree: &mut WideTree,
    spheres: &Spheres,
    settings: &BuildSettings,
) -> BuildReport {
    let mut clock = PhaseClock::new();
    let common = match spheres.radius {
        SphereRadius::Common(radius) => Some(radius),
        SphereRadius::Each(_) => None,
    };
    // Radii per particle are gathered by index, so the build needs the indices then.
    let indexed = settings.keep_indices || common.is_none();
    tree.reset(spheres.centers.len(), common, indexed);

    // Order the particles in the memory of the blocks
    let (points, indices) = tree.points_mut();
    let lap = |phase| clock.lap(phase);
    let scratch_bytes = kd::order_into(spheres.centers, points, indices, lap);

    // Complete the blocks and build the nodes over them
    tree.pad_last_block();
    if let SphereRadius::Each(radii) = spheres.radius {
        tree.gather_radii(radii);
    }
    let sah_cost = tree.finish(TopLevels::InOrder);
    if !settings.keep_indices {
        tree.drop_indices();
    }
    clock.lap("nodes");

    tree.report(
        Structure::Kdtree,
        "k-d, medians of the widest axis",
        sah_cost,
        scratch_bytes,
        clock.finish(),
    )
}
