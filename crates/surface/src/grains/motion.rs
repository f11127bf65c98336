//! Rotations while the shutter is open.

use glam::{DVec3, Vec3};

use super::instance::Motion;
use crate::hierarchy::single;
use spherule_tree::accel::moving::bounded;

/// The largest angle of a rotation, radians. With more turns, the mean over the exposure stays the same, and rounding
/// in f32 would be larger than tests of rays allow for.
const MAX_ANGLE: f64 = 16.0 * std::f64::consts::PI;

impl Motion {
    /// The motion by `displacement` and `rotation`, a vector along the axis whose length is the angle in radians. What
    /// is not finite counts as no motion.
    pub(super) fn new(displacement: Vec3, rotation: Vec3) -> Self {
        let rotation = if rotation.is_finite() { rotation.as_dvec3() } else { DVec3::ZERO };
        let turn = rotation.clamp_length_max(MAX_ANGLE);
        Self { displacement: bounded(displacement).to_array(), turn: turn.to_array().map(single) }
    }
}

/// The shortest rotation from one orientation to another, both quaternions x, y, z, w, times `factor`: a vector along
/// its axis with the angle in radians as its length. For two frames and a shutter that is open for a part of the time
/// between them, that part is the factor. Zero if a quaternion is not finite or zero.
pub fn rotation_between(from: [f32; 4], to: [f32; 4], factor: f32) -> Vec3 {
    let [a, b] = [from, to].map(|q| q.map(f64::from));
    // The product of `to` and the conjugate of `from`
    let vector = DVec3::new(
        b[0] * a[3] - b[3] * a[0] - b[1] * a[2] + b[2] * a[1],
        b[1] * a[3] - b[3] * a[1] - b[2] * a[0] + b[0] * a[2],
        b[2] * a[3] - b[3] * a[2] - b[0] * a[1] + b[1] * a[0],
    );
    let real: f64 = (0..4).map(|i| a[i] * b[i]).sum();
    // Both signs of a quaternion are the same rotation
    let (vector, real) = if real < 0.0 { (-vector, -real) } else { (vector, real) };
    let angle = 2.0 * libm::atan2(vector.length(), real) * f64::from(factor);
    match vector.try_normalize() {
        Some(axis) if angle.is_finite() => (axis * angle).as_vec3(),
        _ => Vec3::ZERO,
    }
}
