//! The shape of a cloud of particles: its principal axes, and whether it has an end.

use glam::{DMat3, DVec3};

use super::robust::sorted_sample;

/// Principal axes with the extents along them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Unit vectors: along the largest extent, the middle one and the smallest.
    pub directions: [DVec3; 3],
    /// The standard deviations along these.
    pub deviations: [f64; 3],
}

/// Rotations of a sweep, and sweeps: the method converges quadratically.
const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];
const SWEEPS: usize = 12;

impl Axes {
    /// The axes of `points`; none of fewer than two.
    pub(super) fn of(points: &[DVec3]) -> Option<Self> {
        #[expect(clippy::cast_precision_loss, reason = "a sample")]
        let count = points.len() as f64;
        let mean = points.iter().sum::<DVec3>() / count;
        let mut covariance = DMat3::ZERO;
        for point in points {
            let d = *point - mean;
            covariance += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        covariance *= 1.0 / count;
        if points.len() < 2 || !covariance.is_finite() {
            return None;
        }
        let (variances, vectors) = eigen(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| variances[*b].total_cmp(&variances[*a]));
        Some(Self {
            directions: order.map(|axis| vectors.col(axis)),
            deviations: order.map(|axis| variances[axis].max(0.0).sqrt()),
        })
    }
}

/// Eigenvalues and eigenvectors of a symmetric matrix, by Jacobi's rotations (Golub and Van Loan, "Matrix Computations",
/// section 8.5).
fn eigen(mut matrix: DMat3) -> (DVec3, DMat3) {
    let mut vectors = DMat3::IDENTITY;
    // Rotate each pair of axes in turn, until nothing is left beside the diagonal
    for (p, q) in (0..SWEEPS).flat_map(|_| PAIRS) {
        let off = matrix.col(q)[p];
        if off == 0.0 {
            continue;
        }
        // Choose the rotation that removes the element of this pair
        let theta = 0.5 * (matrix.col(q)[q] - matrix.col(p)[p]) / off;
        let sign = if theta < 0.0 { -1.0 } else { 1.0 };
        let t = sign / (theta.abs() + libm::hypot(theta, 1.0));
        let cos = 1.0 / libm::hypot(t, 1.0);
        let sin = t * cos;
        // Rotate the matrix, and collect the rotations
        let mut rotation = DMat3::IDENTITY;
        rotation.col_mut(p)[p] = cos;
        rotation.col_mut(q)[q] = cos;
        rotation.col_mut(q)[p] = sin;
        rotation.col_mut(p)[q] = -sin;
        matrix = rotation.transpose() * matrix * rotation;
        vectors *= rotation;
    }
    (DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z), vectors)
}

/// Fewest particles of a cloud.
const MIN_CLOUD: usize = 100;

/// How many times the distance that holds 90 % of a cloud must be that which holds half of it, and the one of 99 % that of
/// 90 %: in a galaxy 2.5 to 10, in an exponential disc 2.3 and 1.7, in a normal distribution 1.6 and 1.3.
const TAIL: f64 = 1.9;

/// How many times the distance of 10 % of the particles on a side, along an axis, must be that of 1 %: in a normal
/// distribution 1.8; at a wall or a floor less than 1.3.
const SIDE_TAIL: f64 = 1.5;

/// Whether most particles are near the middle of a cloud that thins out on all sides, such as a galaxy. A fluid with
/// splashes does not: it has a floor and walls.
pub(super) fn has_heavy_tails(sample: &[DVec3]) -> bool {
    let axes = [0, 1, 2].map(|axis| sorted_sample(sample.len(), |i| sample[i][axis]));
    let along = |axis: usize, part: usize| {
        let values = &axes[axis];
        values.get(values.len() * part / 100).copied().unwrap_or_default()
    };
    let middle = DVec3::from_array([0, 1, 2].map(|axis| along(axis, 50)));
    let ends = |axis: usize, [most, nearly_all]: [usize; 2]| {
        let [most, nearly_all] =
            [most, nearly_all].map(|part| (along(axis, part) - middle[axis]).abs());
        most > 0.0 && nearly_all < SIDE_TAIL * most
    };
    if [0, 1, 2].into_iter().any(|axis| ends(axis, [10, 1]) || ends(axis, [90, 99])) {
        return false;
    }
    let distances = sorted_sample(sample.len(), |i| sample[i].distance(middle));
    let at = |part: usize| distances.get(distances.len() * part / 100).copied().unwrap_or_default();
    let [half, most, nearly_all] = [50, 90, 99].map(at);
    distances.len() >= MIN_CLOUD && most > TAIL * half && nearly_all > TAIL * most
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_those_of_a_turned_box() {
        let turn = DMat3::from_rotation_z(0.4) * DMat3::from_rotation_x(1.1);
        let points = (0..1000).map(|i| [i % 10, i / 10 % 10, i / 100].map(f64::from));
        let size = DVec3::new(1.0, 5.0, 2.0);
        let points: Vec<DVec3> = points.map(|p| turn * (DVec3::from_array(p) * size)).collect();
        let axes = Axes::of(&points).expect("axes");
        for (found, axis) in axes.directions.into_iter().zip([DVec3::Y, DVec3::Z, DVec3::X]) {
            assert!((found.dot(turn * axis).abs() - 1.0).abs() < 1e-12, "{found}");
        }
        let [first, .., last] = axes.deviations;
        assert!((first / last - 5.0).abs() < 1e-9);
        assert_eq!(Axes::of(&[DVec3::ONE]), None);
        assert_eq!(Axes::of(&[DVec3::ONE; 3]).expect("axes").deviations, [0.0; 3]);
    }

    #[test]
    fn galaxies_have_no_end_and_balls_have_one() {
        // Distances of a sphere of Plummer's, and of a ball, in all directions
        let cloud = |distance: fn(f64) -> f64| -> Vec<DVec3> {
            let point = |i: i32| {
                let (part, angle) = ((f64::from(i) + 0.5) / 2000.0, 2.4 * f64::from(i));
                let z = 2.0 * (f64::from(i) * 0.618_034).fract() - 1.0;
                let r = (1.0 - z * z).sqrt();
                distance(part) * DVec3::new(r * libm::cos(angle), r * libm::sin(angle), z)
            };
            (0..2000).map(point).collect()
        };
        assert!(has_heavy_tails(&cloud(|part| (libm::pow(part, -2.0 / 3.0) - 1.0).powf(-0.5))));
        assert!(!has_heavy_tails(&cloud(libm::cbrt)));
        assert!(!has_heavy_tails(&[]));
        // The same with a floor, as of water that splashes
        let mut splash = cloud(|part| (libm::pow(part, -2.0 / 3.0) - 1.0).powf(-0.5));
        splash.iter_mut().for_each(|p| p.z = p.z.max(-1.0));
        assert!(!has_heavy_tails(&splash));
        // A ball and another one far away
        let mut two = cloud(libm::cbrt);
        two.iter_mut().take(100).for_each(|p| p.x += 30.0);
        assert!(!has_heavy_tails(&two));
    }
}
