//! The smallest principal component in three dimensions, in closed form: glam has no eigenvectors of symmetric
//! matrices, and iteration has no advantage for a matrix this small.

use std::ops::Sub;

use glam::DVec3;

/// The elements xx, yy, zz, xy, xz, yz.
#[derive(Debug, Clone, Copy)]
pub(super) struct SymmetricMatrix(pub(super) [f64; 6]);

/// Converts second moments about zero to second moments about the mean, by subtracting the mean.
impl Sub<DVec3> for SymmetricMatrix {
    type Output = Self;

    fn sub(self, DVec3 { x, y, z }: DVec3) -> Self {
        let products = [x * x, y * y, z * z, x * y, x * z, y * z];
        Self(std::array::from_fn(|i| self.0[i] - products[i]))
    }
}

/// The direction of least variance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Least {
    /// Unit vector with either sign.
    pub(super) direction: DVec3,
    /// Difference to the second smallest variance, as a fraction of the latter: 0 to 1.
    pub(super) gap: f64,
}

/// Larger than the variance that rounding to f32 adds to a set without extent, in squared supports.
const NOISE: f64 = 1e-6;

/// The smallest component of `matrix`, whose eigenvalues are not negative; None if there is no unique direction. The
/// eigenvalues follow from the angle of the characteristic cubic (Smith 1961, "Eigenvalues of a symmetric 3 x 3
/// matrix").
pub(super) fn least_component(matrix: &SymmetricMatrix) -> Option<Least> {
    let [xx, yy, zz, xy, xz, yz] = matrix.0;
    // Normalise the matrix by its mean and scale
    let mean = (xx + yy + zz) / 3.0;
    let [a, b, c] = [xx - mean, yy - mean, zz - mean];
    let around = a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz);
    let scale = (around / 6.0).sqrt();
    if scale.is_nan() || scale <= NOISE {
        return None;
    }
    // Compute the eigenvalues
    let determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let cosine = (determinant / (2.0 * scale * scale * scale)).clamp(-1.0, 1.0);
    let angle = libm::acos(cosine) / 3.0;
    let third = std::f64::consts::TAU / 3.0;
    let largest_value = mean + 2.0 * scale * libm::cos(angle);
    let least = mean + 2.0 * scale * libm::cos(angle + third);
    let second = 3.0 * mean - largest_value - least;
    // Compute the eigenvector: perpendicular to two rows of the matrix minus the eigenvalue; the longest product is
    // the most accurate
    let rows = [
        DVec3::new(xx - least, xy, xz),
        DVec3::new(xy, yy - least, yz),
        DVec3::new(xz, yz, zz - least),
    ];
    let across = [rows[0].cross(rows[1]), rows[1].cross(rows[2]), rows[2].cross(rows[0])];
    let longest =
        across.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    if longest.length() <= 1e-9 * scale * scale {
        return None;
    }
    Some(Least {
        direction: longest.normalize(),
        gap: ((second - least.max(0.0)) / second).clamp(0.0, 1.0),
    })
}
