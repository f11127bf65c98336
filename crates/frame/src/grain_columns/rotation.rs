//! Rotations as quaternions x, y, z, w.

use super::AngleUnit;

/// The rotation by Euler angles about the z axis, the rotated x axis and the rotated z axis (Goldstein, *Classical
/// Mechanics*, section 4.4).
pub(super) fn from_euler(angles: [f64; 3], unit: AngleUnit) -> [f64; 4] {
    let half = match unit {
        AngleUnit::Degrees => 0.5f64.to_radians(),
        AngleUnit::Radians => 0.5,
    };
    let [a, b, c] = angles.map(|angle| half * angle);
    let ((sin_b, cos_b), (sin_sum, cos_sum)) = (libm::sincos(b), libm::sincos(a + c));
    let (sin_difference, cos_difference) = libm::sincos(a - c);
    [sin_b * cos_difference, sin_b * sin_difference, cos_b * sin_sum, cos_b * cos_sum]
}

/// Deviation of the determinant of a matrix from 1, up to which it is a rotation with rounded numbers.
const MAX_DEVIATION: f64 = 0.05;

/// The rotation of a matrix, row by row; NaN if it is not one. The largest component is computed first (Shepperd,
/// "Quaternion from rotation matrix", 1978).
pub(super) fn from_matrix(rows: &[f64]) -> [f64; 4] {
    let &[xx, xy, xz, yx, yy, yz, zx, zy, zz] = rows else {
        return [f64::NAN; 4];
    };
    let determinant =
        xx * (yy * zz - yz * zy) - xy * (yx * zz - yz * zx) + xz * (yx * zy - yy * zx);
    // False for NaN
    let is_rotation = (determinant - 1.0).abs() < MAX_DEVIATION;
    if !is_rotation {
        return [f64::NAN; 4];
    }
    // Four times the squares of the components
    let squares = [1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz, 1.0 + xx + yy + zz];
    let largest = (1..4).fold(0, |a, b| if squares[b] > squares[a] { b } else { a });
    let scale = 0.5 / squares[largest].sqrt();
    let products = match largest {
        0 => [squares[0], xy + yx, xz + zx, zy - yz],
        1 => [xy + yx, squares[1], yz + zy, xz - zx],
        2 => [xz + zx, yz + zy, squares[2], yx - xy],
        _ => [zy - yz, xz - zx, yx - xy, squares[3]],
    };
    products.map(|product| scale * product)
}
