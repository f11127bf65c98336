//! Where a grain is and how it is turned, in f64.

use glam::DVec3;

use super::instance::{Instance, Motion};

/// The transformation between the coordinates of the tree and the unit coordinates of a grain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    /// Centre, relative to that of the tree.
    pub(super) center: DVec3,
    /// The axes of the grain, divided by its semi-axes.
    rows: [DVec3; 3],
}

impl Pose {
    /// The pose of a grain that does not move.
    pub(super) fn fixed(grain: &Instance) -> Self {
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        Self { center: vector(grain.center), rows: grain.rows.map(vector) }
    }

    /// The pose at `time`, from -1/2 to 1/2.
    pub(super) fn at(grain: &Instance, motion: &Motion, time: f32) -> Self {
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from)) * f64::from(time);
        let Self { center, rows } = Self::fixed(grain);
        let center = center + vector(motion.displacement);
        let turn = vector(motion.turn);
        let angle = turn.length();
        if angle == 0.0 {
            return Self { center, rows };
        }
        // Rotate by a unit quaternion
        let (sine, real) = libm::sincos(0.5 * angle);
        let axis = turn * (sine / angle);
        let rotated = |v: DVec3| {
            let a = axis.cross(v);
            v + 2.0 * (real * a + axis.cross(a))
        };
        Self { center, rows: rows.map(rotated) }
    }

    /// A point in unit coordinates.
    pub(super) fn unit_point(&self, point: DVec3) -> DVec3 {
        self.unit_direction(point - self.center)
    }

    /// A vector in unit coordinates.
    pub(super) fn unit_direction(&self, vector: DVec3) -> DVec3 {
        let [x, y, z] = self.rows.map(|row| row.dot(vector));
        DVec3::new(x, y, z)
    }

    /// The unit normal of a surface whose gradient in unit coordinates is `g`.
    pub(super) fn normal(&self, g: DVec3) -> Option<DVec3> {
        (self.rows[0] * g.x + self.rows[1] * g.y + self.rows[2] * g.z).try_normalize()
    }

    /// The semi-axes as vectors.
    pub(super) fn semi_axes(&self) -> [DVec3; 3] {
        self.rows.map(|row| row / row.length_squared())
    }
}
