//! `kdtree`: a k-d tree (Bentley 1975) with medians of the widest axis down to a block, folded into
//! implicit 8-wide levels: the fastest to trace.
//!
//! The order is all there is to find (`order/kd` in `spherule-formats`); nodes are arithmetic.

use spherule_formats::order::kd;

use super::levels::UpperLevels;
use super::report::PhaseClock;
use super::wide::WideTree;
use super::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure};

/// Builds over `spheres` in the memory of `tree`.
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
    // Radii of their own follow by index, so then the indices are needed while building.
    let indexed = settings.keep_indices || common.is_none();
    tree.reset(spheres.centers.len(), common, indexed);

    let (points, indices) = tree.points_mut();
    let lap = |phase| clock.lap(phase);
    let scratch_bytes = kd::order_into(spheres.centers, points, indices, lap);

    tree.pad_last_block();
    if let SphereRadius::Each(radii) = spheres.radius {
        tree.gather_radii(radii);
    }
    let sah_cost = tree.finish(UpperLevels::InOrder);
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
