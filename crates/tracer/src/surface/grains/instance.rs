//! A grain as the tree stores it.

/// A grain. With its share of the nodes, it takes less than 100 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(super) struct Instance {
    /// Centre, relative to the centre of the tree.
    pub(super) center: [f32; 3],
    /// Index in the arrays of the caller.
    pub(super) index: u32,
    /// Unit quaternion x, y, z, w from its own axes to those of the scene.
    pub(super) orientation: [f32; 4],
    /// Factors from lengths along its own axes to unit coordinates.
    pub(super) inverse: [f32; 3],
}

/// Motion of a grain.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub(super) struct Motion {
    /// Displacement from the opening of the shutter to its closing.
    pub(super) displacement: [f32; 3],
    /// Axis of the rotation, with the tangent of a quarter of its angle as its length.
    pub(super) turn: [f32; 3],
}

/// The product of the quaternions `a` and `b`, x, y, z, w: the rotation `b` followed by `a`.
#[inline(always)]
pub(super) fn product(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// `orientation` at `time`, from -1/2 to 1/2, with the rotation `turn` of a [`Motion`].
#[inline(always)]
pub(super) fn orientation_at(orientation: [f32; 4], turn: [f32; 3], time: f32) -> [f32; 4] {
    let part = 2.0 * time;
    let q = product([part * turn[0], part * turn[1], part * turn[2], 1.0], orientation);
    let inverse = 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    [q[0] * inverse, q[1] * inverse, q[2] * inverse, q[3] * inverse]
}

/// The rows of the matrix from the scene to unit coordinates, for an `orientation` and the factors `inverse`.
#[inline(always)]
pub(super) fn unit_rows([x, y, z, w]: [f32; 4], inverse: [f32; 3]) -> [[f32; 3]; 3] {
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, xy, xz) = (x * x2, x * y2, x * z2);
    let (yy, yz, zz) = (y * y2, y * z2, z * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    let [a, b, c] = inverse;
    // The columns of the rotation are the axes of the grain
    [
        [(1.0 - (yy + zz)) * a, (xy + wz) * a, (xz - wy) * a],
        [(xy - wz) * b, (1.0 - (xx + zz)) * b, (yz + wx) * b],
        [(xz + wy) * c, (yz - wx) * c, (1.0 - (xx + yy)) * c],
    ]
}
