//! Superquadrics with exponents from 1 on, which are convex.
//!
//! The function `h(p) = ((|x|^n2 + |y|^n2)^(n1/n2) + |z|^n1)^(1/n1)` is 1 on the surface, and it is a norm: along a ray,
//! it is convex. Newton's method from outside therefore never passes the first root, since tangents lie below the
//! function, and a ray misses the body exactly if the slope turns positive before there is a root. Corners are not
//! missed, however large the exponents.

use glam::DVec3;

use super::{Hit, slab};

/// Steps of Newton's method. It needs less than ten, and one for each bit of the mantissa where a ray touches the body.
const MAX_STEPS: usize = 64;

/// Deviation of the norm from 1 that counts as a point of the surface.
const TOLERANCE: f64 = 1e-12;

/// The norm `(a^n + b^n)^(1/n)` of numbers that are not negative, and its derivatives.
fn norm_of_two(a: f64, b: f64, n: f64) -> [f64; 3] {
    if n == 2.0 {
        let norm = (a * a + b * b).sqrt();
        return if norm > 0.0 { [norm, a / norm, b / norm] } else { [0.0; 3] };
    }
    let (large, small) = if a < b { (b, a) } else { (a, b) };
    // False for NaN
    let is_positive = large > 0.0;
    if !is_positive {
        return [0.0; 3];
    }
    // Without powers of large numbers
    let ratio = small / large;
    let [power, root] = power_and_root(ratio, n);
    let of_large = root / (1.0 + power);
    let of_small = if ratio > 0.0 {
        power / ratio * of_large
    } else if n == 1.0 {
        of_large
    } else {
        0.0
    };
    let norm = large * root;
    if a < b { [norm, of_small, of_large] } else { [norm, of_large, of_small] }
}

/// The power `x^n` of a number from 0 to 1, and the root `(1 + x^n)^(1/n)`.
fn power_and_root(x: f64, n: f64) -> [f64; 2] {
    /// Exponents that are powers of two need no logarithms.
    const SQUARINGS: [(f64, u32); 4] = [(4.0, 2), (8.0, 3), (16.0, 4), (32.0, 5)];
    match SQUARINGS.iter().find(|(exponent, _)| *exponent == n) {
        Some((_, count)) => {
            let power = (0..*count).fold(x, |power, _| power * power);
            [power, (0..*count).fold(1.0 + power, |root, _| root.sqrt())]
        }
        None => {
            let power = libm::pow(x, n);
            [power, libm::pow(1.0 + power, 1.0 / n)]
        }
    }
}

/// The norm of a point, and its gradient.
fn norm(point: DVec3, [n1, n2]: [f64; 2]) -> (f64, DVec3) {
    let p = point.abs();
    let [across, of_x, of_y] = norm_of_two(p.x, p.y, n2);
    let [norm, of_across, of_z] = norm_of_two(across, p.z, n1);
    let gradient = DVec3::new(of_across * of_x, of_across * of_y, of_z);
    (norm, gradient * point.signum())
}

/// The largest value of the dot product of a point of the body and `direction`, whose components are not negative: the
/// dual norm.
pub(super) fn support(direction: DVec3, [n1, n2]: [f64; 2]) -> f64 {
    let dual = |a: f64, b: f64, n: f64| {
        if n > 1.0 { norm_of_two(a, b, n / (n - 1.0))[0] } else { a.max(b) }
    };
    dual(dual(direction.x, direction.y, n2), direction.z, n1)
}

/// The squared radius of a sphere around the body.
pub(super) fn radius_squared([n1, n2]: [f64; 2]) -> f64 {
    // A square has the corner (1, 1), other curves have points before it
    let corner = |n: f64, side: f64| {
        if n <= 2.0 { f64::max(1.0, side) } else { 1.0 + side }
    };
    corner(n1, corner(n2, 1.0))
}

/// The first crossing of the surface from distance `from` on.
pub(super) fn first(
    origin: DVec3,
    direction: DVec3,
    exponents: [f64; 2],
    from: f64,
) -> Option<Hit> {
    // The body is in the cube from -1 to 1
    let [start, end] = slab::interval(origin, direction, &[0, 1, 2])?.map(|end| end.t);
    let near = root(origin, direction, exponents, [start, end])?;
    if near.t >= from {
        return Some(near);
    }
    // The ray starts behind its entry: search from the other end of the line
    let far = root(origin, -direction, exponents, [-end, -start])?;
    (-far.t >= from).then_some(Hit { t: -far.t, ..far })
}

/// The first point of the surface in a range that starts outside the body.
fn root(
    origin: DVec3,
    direction: DVec3,
    exponents: [f64; 2],
    [start, end]: [f64; 2],
) -> Option<Hit> {
    let mut t = start;
    for _ in 0..MAX_STEPS {
        let (norm, gradient) = norm(origin + t * direction, exponents);
        let (value, slope) = (norm - 1.0, gradient.dot(direction));
        if value <= TOLERANCE {
            return Some(Hit::new(t, gradient));
        }
        // Otherwise, the function only grows from here on; false for NaN
        let is_approaching = slope < 0.0;
        if !is_approaching {
            return None;
        }
        let next = t - value / slope;
        if next > end {
            return None;
        }
        if next <= t {
            return Some(Hit::new(t, gradient));
        }
        t = next;
    }
    None
}
