//! A grain as the tree stores it.

use spherule_tree::math::larger;

/// A grain. With its share of the nodes, it takes less than 100 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(super) struct Instance {
    /// Centre, relative to the centre of the tree.
    pub(super) center: [f32; 3],
    /// Index in the arrays of the caller.
    pub(super) index: u32,
    /// Rows of the matrix from vectors of the scene to unit coordinates, in the middle of the exposure: the axes of the
    /// grain divided by its semi-axes.
    pub(super) rows: [[f32; 3]; 3],
}

/// Motion of a grain.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub(super) struct Motion {
    /// Displacement from the opening of the shutter to its closing.
    pub(super) displacement: [f32; 3],
    /// Axis of the rotation from the opening to the closing, with its angle in radians as its length.
    pub(super) turn: [f32; 3],
}

/// A rotation about an axis through the centre, as a unit quaternion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rotation {
    vector: [f32; 3],
    real: f32,
}

impl Motion {
    /// The rotation from the middle of the exposure to `time`, from -1/2 to 1/2.
    #[inline(always)]
    pub(super) fn rotation(&self, time: f32) -> Rotation {
        let [x, y, z] = self.turn;
        let angle = (x * x + y * y + z * z).sqrt();
        let (sine, real) = sin_cos(0.5 * angle * time);
        // Zero without a rotation
        let scale = sine / larger(angle, f32::MIN_POSITIVE);
        Rotation { vector: [scale * x, scale * y, scale * z], real }
    }
}

/// Sine and cosine of an angle of up to 4 pi, radians: those of a sixteenth of it, with the angle doubled four times. The
/// function of `math` converts to integers, with which moving grains take four times as long.
#[inline(always)]
fn sin_cos(angle: f32) -> (f32, f32) {
    // Approximate both on -pi/4..=pi/4
    let r = angle * (1.0 / 16.0);
    let z = r * r;
    let mut sine = r + r * z * (-1.666_665_5e-1 + z * (8.332_161e-3 - z * 1.951_529_6e-4));
    let mut cosine =
        1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    for _ in 0..4 {
        (sine, cosine) = (2.0 * sine * cosine, 1.0 - 2.0 * sine * sine);
    }
    (sine, cosine)
}

impl Rotation {
    /// `v` rotated.
    #[inline(always)]
    pub(super) fn apply(&self, v: [f32; 3]) -> [f32; 3] {
        let a = cross(self.vector, v);
        let b = cross(self.vector, a);
        let moved = |axis: usize| v[axis] + 2.0 * (self.real * a[axis] + b[axis]);
        [moved(0), moved(1), moved(2)]
    }
}

impl Instance {
    /// The position of a point relative to the centre, and a direction, both rotated as the grain was rotated from
    /// `time`, from -1/2 to 1/2, to the middle of the exposure.
    #[inline(always)]
    pub(super) fn in_middle(
        &self,
        motion: Option<&Motion>,
        time: f32,
        point: [f32; 3],
        direction: [f32; 3],
    ) -> [[f32; 3]; 2] {
        let c = &self.center;
        let Some(motion) = motion else {
            return [[point[0] - c[0], point[1] - c[1], point[2] - c[2]], direction];
        };
        let d = &motion.displacement;
        let moved = [c[0] + time * d[0], c[1] + time * d[1], c[2] + time * d[2]];
        let from_center = [point[0] - moved[0], point[1] - moved[1], point[2] - moved[2]];
        let back = motion.rotation(-time);
        [back.apply(from_center), back.apply(direction)]
    }

    /// A vector in unit coordinates.
    #[inline(always)]
    pub(super) fn unit(&self, v: [f32; 3]) -> [f32; 3] {
        let [a, b, c] = &self.rows;
        [
            a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
            b[0] * v[0] + b[1] * v[1] + b[2] * v[2],
            c[0] * v[0] + c[1] * v[1] + c[2] * v[2],
        ]
    }
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The axes of a grain with the unit quaternion x, y, z, w from its own axes to those of the scene, each divided by the
/// semi-axis along it.
pub(super) fn unit_rows(orientation: [f64; 4], semi_axes: [f32; 3]) -> [[f32; 3]; 3] {
    let [x, y, z, w] = orientation;
    let [a, b, c] = semi_axes.map(f64::from);
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)].map(|v| v / a),
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)].map(|v| v / b),
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)].map(|v| v / c),
    ];
    rows.map(|row| row.map(crate::hierarchy::single))
}
