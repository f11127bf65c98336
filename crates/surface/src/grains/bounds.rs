//! Boxes around grains.

use glam::DVec3;

use super::body::Body;
use super::instance::{Instance, Motion};
use super::pose::Pose;

/// Factor on boxes for the rounding of sizes and orientations.
const REACH: f64 = 1.0 + 1e-6;

/// The middle of the box of a grain and half its size, relative to the centre of the tree.
pub(super) fn box_of(body: &Body<'_>, grain: &Instance, motion: Option<&Motion>) -> [DVec3; 2] {
    let pose = Pose::fixed(grain);
    let semi_axes = pose.semi_axes().map(|axis| axis * REACH);
    let (mut middle, mut half) = (pose.center, DVec3::ZERO);
    for axis in 0..3 {
        // The direction of the scene in unit coordinates
        let [x, y, z] = semi_axes.map(|own| own[axis]);
        let [center, reach] = body.extent(DVec3::new(x, y, z));
        middle[axis] += center;
        half[axis] = reach;
    }
    match motion {
        None => [middle, half],
        Some(motion) => swept([middle, half], &pose, motion),
    }
}

/// The box during the whole exposure, from that in its middle.
fn swept([middle, half]: [DVec3; 2], pose: &Pose, motion: &Motion) -> [DVec3; 2] {
    let displacement = DVec3::from_array(motion.displacement.map(f64::from));
    let moved = 0.5 * displacement.abs() * REACH;
    let angle = DVec3::from_array(motion.turn.map(f64::from)).length();
    if angle == 0.0 {
        return [middle, half + moved];
    }
    // A point at distance r from the centre moves by at most 2 r sin(a / 2) if it is rotated by up to a, which is half the
    // angle of the exposure, and by at most 2 r from half a turn on
    let sine = libm::sin(0.25 * angle.min(2.0 * std::f64::consts::PI));
    let offset = middle - pose.center;
    let radius = (half.length() + offset.length()) * REACH;
    let rotated = half + 2.0 * radius * sine;
    // No point leaves the sphere around the centre
    let low = (offset - rotated).max(DVec3::splat(-radius));
    let high = (offset + rotated).min(DVec3::splat(radius));
    [pose.center + 0.5 * (low + high), 0.5 * (high - low) + moved]
}
