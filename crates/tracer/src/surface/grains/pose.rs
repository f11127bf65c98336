//! Where a grain is and how it is turned, in f64.

use glam::DVec3;

use super::instance::{Instance, Motion, orientation_at};

/// The transformation between the coordinates of the tree and the unit coordinates of a grain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    /// Centre, relative to that of the tree.
    pub(super) center: DVec3,
    /// The axes of the grain, unit vectors.
    pub(super) axes: [DVec3; 3],
    /// Factors from lengths along these axes to unit coordinates.
    inverse: DVec3,
}

impl Pose {
    /// The pose of a grain that does not move.
    pub(super) fn fixed(grain: &Instance) -> Self {
        Self {
            center: DVec3::from_array(grain.center.map(f64::from)),
            axes: axes_of(grain.orientation),
            inverse: DVec3::from_array(grain.inverse.map(f64::from)),
        }
    }

    /// The pose at `time`, from -1/2 to 1/2.
    pub(super) fn at(grain: &Instance, motion: &Motion, time: f32) -> Self {
        let [x, y, z] = motion.displacement.map(|d| f64::from(d) * f64::from(time));
        let orientation = orientation_at(grain.orientation, motion.turn, time);
        let pose = Self::fixed(&Instance { orientation, ..*grain });
        Self { center: pose.center + DVec3::new(x, y, z), ..pose }
    }

    /// A point in unit coordinates.
    pub(super) fn unit_point(&self, point: DVec3) -> DVec3 {
        self.unit_direction(point - self.center)
    }

    /// A vector in unit coordinates.
    pub(super) fn unit_direction(&self, vector: DVec3) -> DVec3 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(vector));
        DVec3::new(x, y, z) * self.inverse
    }

    /// The unit normal of a surface whose gradient in unit coordinates is `gradient`.
    pub(super) fn normal(&self, gradient: DVec3) -> Option<DVec3> {
        let g = gradient * self.inverse;
        (self.axes[0] * g.x + self.axes[1] * g.y + self.axes[2] * g.z).try_normalize()
    }

    /// The semi-axes.
    pub(super) fn semi_axes(&self) -> DVec3 {
        self.inverse.recip()
    }
}

/// The unit vectors that a quaternion x, y, z, w rotates the axes to.
pub(super) fn axes_of(orientation: [f32; 4]) -> [DVec3; 3] {
    // Normalise it again, since it is rounded to single precision
    let q = orientation.map(f64::from);
    let scale = 2.0 / q.iter().map(|c| c * c).sum::<f64>();
    let [x, y, z, w] = q;
    let (xx, xy, xz) = (x * x * scale, x * y * scale, x * z * scale);
    let (yy, yz, zz) = (y * y * scale, y * z * scale, z * z * scale);
    let (wx, wy, wz) = (w * x * scale, w * y * scale, w * z * scale);
    [
        DVec3::new(1.0 - (yy + zz), xy + wz, xz - wy),
        DVec3::new(xy - wz, 1.0 - (xx + zz), yz + wx),
        DVec3::new(xz + wy, yz - wx, 1.0 - (xx + yy)),
    ]
}
