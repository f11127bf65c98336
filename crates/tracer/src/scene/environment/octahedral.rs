//! The equal-area octahedral map between the square and the sphere (Clarberg, "Fast Equal-Area Mapping of the
//! (Hemi)Sphere using SIMD", 2008). The zenith is at the centre of the square, the horizon is the diamond between the
//! midpoints of its edges, and the nadir is at all four corners. Equal areas of the square are equal solid angles.
//!
//! Both functions are free of calls and branches, so that loops over lanes vectorise.

use std::f32::consts::{FRAC_2_PI, FRAC_PI_4};

use spherule_tree::math::functions::atan2;

/// The unit vector of a point of the square, whose coordinates are in -1..=1.
#[inline(always)]
pub(super) fn square_to_sphere(x: f32, y: f32) -> [f32; 3] {
    // Fold the square to a quadrant of the upper hemisphere: `r` is 0 at the pole and 1 at the horizon
    let (ax, ay) = (x.abs(), y.abs());
    let above = 1.0 - (ax + ay);
    let r = 1.0 - above.abs();
    // The longitude in the quadrant is pi/4 plus this angle
    let angle = (ay - ax) / (if r > 0.0 { r } else { 1.0 }) * FRAC_PI_4;
    // Cephes' polynomials on -pi/4..=pi/4, see `math::functions::sin_cos`
    let square = angle * angle;
    let mut s = -1.951_529_6e-4;
    s = s * square + 8.332_161e-3;
    s = s * square - 1.666_665_5e-1;
    let sin = s * square * angle + angle;
    let mut c = 2.443_315_7e-5;
    c = c * square - 1.388_731_6e-3;
    c = c * square + 4.166_664_6e-2;
    let cos = c * square * square - 0.5 * square + 1.0;
    // Half of the squared distance to the axis, because the sums of sine and cosine are too long by its root
    let r2 = r * r;
    let half = 1.0 - 0.5 * r2;
    let level = r * (if half > 0.0 { half } else { 0.0 }).sqrt();
    [
        (level * (cos - sin)).copysign(x),
        (level * (cos + sin)).copysign(y),
        (1.0 - r2).copysign(above),
    ]
}

/// The point of the square, with coordinates in -1..=1, of a unit vector.
#[inline(always)]
pub(super) fn sphere_to_square(x: f32, y: f32, z: f32) -> [f32; 2] {
    let rest = 1.0 - z.abs();
    let r = (if rest > 0.0 { rest } else { 0.0 }).sqrt();
    let quarter = atan2(y.abs(), x.abs()) * FRAC_2_PI;
    let ay = quarter * r;
    let ax = r - ay;
    // Unfold the lower hemisphere
    let is_below = z < 0.0;
    let u = if is_below { 1.0 - ay } else { ax };
    let v = if is_below { 1.0 - ax } else { ay };
    [u.copysign(x), v.copysign(y)]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const COUNT: u16 = 400;

    /// Points of a grid over the square, with its edges.
    fn points() -> impl Iterator<Item = [f32; 2]> {
        let at = |i: u16| f32::from(i) / f32::from(COUNT) * 2.0 - 1.0;
        (0..=COUNT).flat_map(move |i| (0..=COUNT).map(move |j| [at(i), at(j)]))
    }

    /// The map in double precision, from the publication.
    fn exact(x: f32, y: f32) -> DVec3 {
        let (x, y) = (f64::from(x), f64::from(y));
        let above = 1.0 - (x.abs() + y.abs());
        let r = 1.0 - above.abs();
        let turn = if r == 0.0 { 1.0 } else { (y.abs() - x.abs()) / r + 1.0 };
        let (sin, cos) = (turn * std::f64::consts::FRAC_PI_4).sin_cos();
        let level = r * (2.0 - r * r).sqrt();
        DVec3::new(
            (level * cos).copysign(x),
            (level * sin).copysign(y),
            (1.0 - r * r).copysign(above),
        )
    }

    #[test]
    fn directions_are_those_of_the_publication() {
        for [x, y] in points() {
            let [a, b, c] = square_to_sphere(x, y).map(f64::from);
            let found = DVec3::new(a, b, c);
            assert!((found - exact(x, y)).length() < 5e-7, "{x} {y}: {found}");
            assert!((found.length() - 1.0).abs() < 5e-7, "{x} {y}: {found}");
        }
    }

    #[test]
    fn directions_return_to_their_points() {
        for [x, y] in points() {
            let [a, b, c] = square_to_sphere(x, y);
            let [u, v] = sphere_to_square(a, b, c);
            let again = exact(u, v);
            // On the folds of the lower hemisphere, two points have the same direction
            assert!((again - exact(x, y)).length() < 1e-3, "{x} {y}: {u} {v}");
            if x.abs().max(y.abs()) < 0.999 {
                assert!((u - x).abs().max((v - y).abs()) < 5e-4, "{x} {y}: {u} {v}");
            }
        }
    }

    #[test]
    fn equal_areas_are_equal_solid_angles() {
        // The area of small quadrilaterals on the sphere
        let cell = 2.0 / f32::from(COUNT);
        for [x, y] in points().filter(|[x, y]| *x < 0.99 && *y < 0.99) {
            let corner = |i: f32, j: f32| exact(x + i * cell, y + j * cell);
            let [a, b, c, d] =
                [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            let area = 0.5 * ((c - a).cross(d - b)).length();
            let wanted = std::f64::consts::PI * f64::from(cell * cell);
            // Those at the diagonals of the square are folded
            let is_smooth = (x.abs() - y.abs()).abs() > 2.0 * cell;
            let is_smooth = is_smooth && (x.abs() + y.abs() - 1.0).abs() > 2.0 * cell;
            let is_smooth = is_smooth && x.abs().min(y.abs()) > 2.0 * cell;
            assert!(!is_smooth || (area / wanted - 1.0).abs() < 0.02, "{x} {y}: {area} {wanted}");
        }
    }

    #[test]
    fn other_numbers_give_no_panic() {
        for value in [f32::NAN, f32::INFINITY, -1e30, 0.0] {
            let _ = (square_to_sphere(value, value), sphere_to_square(value, value, value));
        }
        assert_eq!(sphere_to_square(0.0, 0.0, 1.0), [0.0, 0.0]);
    }
}
