//! Elementary functions in single precision, without the C library and without branches, so that loops over lanes
//! vectorise and all platforms give the same bits.
//!
//! The polynomials are those of Moshier's Cephes library (single precision: `exp2f`, `logf`, `asinf`, `atanf`,
//! `sinf`, `cosf`; "Methods and Programs for Mathematical Functions", 1989). The tests of this file measured the stated
//! errors against double precision.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, LN_2, LOG2_E, PI};

/// Adding and subtracting this constant rounds a number of magnitude below 2^22 to an integer, ties to even.
const ROUND: f32 = 12_582_912.0;

/// `2^x`, relative error below 2e-7. Zero below -150, infinite from 128 on.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers in the range of exponents; NaN becomes 0"
)]
pub fn exp2(x: f32) -> f32 {
    // Keep the exponent in the range of two factors.
    let y = if x > 129.0 { 129.0 } else { x };
    let y = if y < -151.0 { -151.0 } else { y };
    let whole = (y + ROUND) - ROUND;
    let f = y - whole;
    // Approximate 2^f on -1/2..=1/2
    let mut p = 1.535_336_2e-4;
    p = p * f + 1.339_887_4e-3;
    p = p * f + 9.618_437e-3;
    p = p * f + 5.550_332_4e-2;
    p = p * f + 2.402_264_8e-1;
    p = p * f + 6.931_472e-1;
    p = p * f + 1.0;
    // Scale by two factors, so that neither overflows if the product does not
    let exponent = whole as i32;
    let half = exponent >> 1;
    let power = |e: i32| f32::from_bits(((e + 127) as u32) << 23);
    p * power(half) * power(exponent - half)
}

/// `e^x`, relative error below 2e-7 + 1e-7 |x|.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    exp2(x * LOG2_E)
}

/// The base-2 logarithm of a positive normal number, absolute error below 2e-7 + 1e-7 of the result. Zero and
/// denormal numbers give about -127; the results for negative numbers and NaN are meaningless.
#[inline(always)]
#[expect(
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "bits of a number, taken apart"
)]
pub fn log2(x: f32) -> f32 {
    // Split x = 2^e * (1 + f) with 1 + f in sqrt(1/2)..sqrt(2)
    let bits = x.to_bits();
    let e = (bits.wrapping_sub(0x3f35_04f3) as i32) >> 23;
    let f = f32::from_bits(bits.wrapping_sub((e << 23) as u32)) - 1.0;
    let mut p = 7.037_683_6e-2;
    p = p * f - 1.151_461e-1;
    p = p * f + 1.167_699_9e-1;
    p = p * f - 1.242_014_1e-1;
    p = p * f + 1.424_932_3e-1;
    p = p * f - 1.666_805_8e-1;
    p = p * f + 2.000_071_5e-1;
    p = p * f - 2.499_999_4e-1;
    p = p * f + 3.333_333e-1;
    let square = f * f;
    // ln(1 + f) = f + rest; multiply by log2(e) - 1 separately, so that the large part stays exact
    let rest = p * f * square - 0.5 * square;
    (rest * LOG2_E + f * (LOG2_E - 1.0)) + f + e as f32
}

/// The natural logarithm; see [`log2`].
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    log2(x) * LN_2
}

/// `x^y` for `x` in 0..=1 and `y` from 0 to 1e4, relative error below 2e-7 + 2e-7 y |log2 x|. Values of `x` below
/// 1e-30 count as 0, and `0^0` is 1.
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    let is_positive = x > 1e-30;
    let base = if is_positive { x } else { 1.0 };
    let power = exp2(y * log2(base));
    let of_zero = if y == 0.0 { 1.0 } else { 0.0 };
    if is_positive { power } else { of_zero }
}

/// The arc sine of a number in -1..=1, absolute error below 3e-7.
#[inline(always)]
pub fn asin(x: f32) -> f32 {
    let a = x.abs();
    // Near 1, use asin(a) = pi/2 - 2 asin(sqrt((1 - a) / 2))
    let is_large = a > 0.5;
    let z = if is_large { 0.5 * (1.0 - a) } else { a * a };
    let s = if is_large { z.sqrt() } else { a };
    let mut p = 4.216_32e-2;
    p = p * z + 2.418_131_2e-2;
    p = p * z + 4.547_002_6e-2;
    p = p * z + 7.495_3e-2;
    p = p * z + 1.666_675_2e-1;
    let r = s + s * z * p;
    let r = if is_large { FRAC_PI_2 - 2.0 * r } else { r };
    r.copysign(x)
}

/// The arc cosine of a number in -1..=1, absolute error below 4e-7.
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    let a = x.abs();
    let is_large = a > 0.5;
    let small = FRAC_PI_2 - asin(x);
    let s = asin((0.5 * (1.0 - a)).sqrt());
    let large = if x < 0.0 { PI - 2.0 * s } else { 2.0 * s };
    if is_large { large } else { small }
}

/// The angle of the vector `(x, y)` from the x axis, -pi to pi, absolute error below 4e-7. 0 for the zero vector.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    // Reduce to the octant next to the x axis, where tan is 0..=1
    let (ax, ay) = (x.abs(), y.abs());
    let is_steep = ay > ax;
    let (small, large) = if is_steep { (ax, ay) } else { (ay, ax) };
    let large = if large > 0.0 { large } else { 1.0 };
    // Above tan(pi/8), use atan(t) = pi/4 + atan((t - 1) / (t + 1))
    let is_far = small > 0.414_213_57 * large;
    let (above, below) = (small - large, small + large);
    let t = if is_far { above / below } else { small / large };
    let z = t * t;
    let mut p = 8.053_744_5e-2;
    p = p * z - 1.387_768_6e-1;
    p = p * z + 1.997_771_1e-1;
    p = p * z - 3.333_295e-1;
    let angle = p * z * t + t;
    let angle = if is_far { FRAC_PI_4 + angle } else { angle };
    // Return to the octant of the vector
    let angle = if is_steep { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    angle.copysign(y)
}

/// Sine and cosine of an angle of magnitude up to 8192 radians, absolute error below 2e-7.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "quadrants are counted in few bits")]
pub fn sin_cos(x: f32) -> (f32, f32) {
    // Reduce x = quadrant * pi/2 + r with |r| <= pi/4; pi/2 in three parts (Cody and Waite)
    let quadrant = (x * (2.0 * FRAC_1_PI) + ROUND) - ROUND;
    let r = x - quadrant * 1.570_312_5;
    let r = r - quadrant * 4.837_513e-4;
    let r = r - quadrant * 7.549_789_5e-8;
    // Approximate sine and cosine of r
    let z = r * r;
    let mut s = -1.951_529_6e-4;
    s = s * z + 8.332_161e-3;
    s = s * z - 1.666_665_5e-1;
    let sine = s * z * r + r;
    let mut c = 2.443_315_7e-5;
    c = c * z - 1.388_731_6e-3;
    c = c * z + 4.166_664_6e-2;
    let cosine = c * z * z - 0.5 * z + 1.0;
    // Swap and negate them depending on the quadrant
    let quarter = quadrant as i32;
    let (s, c) = if quarter & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
    let s = if quarter & 2 == 0 { s } else { -s };
    let c = if (quarter + 1) & 2 == 0 { c } else { -c };
    (s, c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from `low` to `high`, evenly spaced.
    fn steps(low: f32, high: f32) -> impl Iterator<Item = f32> {
        const COUNT: u32 = 200_000;
        (0..=COUNT).map(move |i| low + (high - low) * (i as f32 / COUNT as f32))
    }

    #[track_caller]
    fn check(
        low: f32,
        high: f32,
        own: impl Fn(f32) -> f32,
        exact: impl Fn(f64) -> f64,
        bound: impl Fn(f64, f64) -> f64,
    ) {
        for x in steps(low, high) {
            let expected = exact(f64::from(x));
            let error = (f64::from(own(x)) - expected).abs();
            let most = bound(f64::from(x), expected);
            assert!(error <= most, "{x}: {} instead of {expected}", own(x));
        }
    }

    #[test]
    fn exp2_is_within_its_error_bound() {
        check(-125.0, 127.9, exp2, f64::exp2, |_, y| 2e-7 * y);
        check(-1.0, 1.0, exp2, f64::exp2, |_, y| 2e-7 * y);
        check(-80.0, 80.0, exp, f64::exp, |x, y| (2e-7 + 1e-7 * x.abs()) * y);
        assert_eq!(exp2(0.0), 1.0);
        assert_eq!(exp2(-1.0), 0.5);
        assert_eq!(exp2(128.0), f32::INFINITY);
        assert_eq!(exp2(f32::INFINITY), f32::INFINITY);
        assert_eq!(exp2(f32::NEG_INFINITY), 0.0);
        assert!(exp2(-140.0) > 0.0);
        assert!(exp2(f32::NAN).is_nan());
    }

    #[test]
    fn log2_is_within_its_error_bound() {
        let bound = |_: f64, y: f64| 2e-7 + 1e-7 * y.abs();
        check(0.3, 3.0, log2, f64::log2, bound);
        check(1e-30, 1e-20, log2, f64::log2, bound);
        check(1.0, 1e30, log2, f64::log2, bound);
        check(0.01, 100.0, ln, f64::ln, bound);
        assert_eq!(log2(1.0), 0.0);
        assert_eq!(log2(8.0), 3.0);
    }

    #[test]
    fn pow_is_within_its_error_bound() {
        for y in [0.5_f32, 1.0, 2.2, 32.0, 500.0] {
            let exponent = f64::from(y);
            let bound = |x: f64, expected: f64| {
                expected * (2e-7 + 2e-7 * exponent * x.log2().abs()) + 1e-37
            };
            check(1e-3, 1.0, |x| pow(x, y), |x| x.powf(exponent), bound);
        }
        assert_eq!(pow(0.0, 0.0), 1.0);
        assert_eq!(pow(0.0, 5.0), 0.0);
        assert_eq!(pow(-1.0, 5.0), 0.0);
        assert_eq!(pow(1.0, 1e4), 1.0);
    }

    #[test]
    fn arc_functions_are_within_their_error_bounds() {
        check(-1.0, 1.0, asin, f64::asin, |_, _| 3e-7);
        check(-1.0, 1.0, acos, f64::acos, |_, _| 4e-7);
        assert_eq!((asin(0.0), acos(1.0)), (0.0, 0.0));
    }

    #[test]
    fn angles_of_vectors_are_within_their_error_bounds() {
        for angle in steps(-std::f32::consts::PI, std::f32::consts::PI) {
            let exact = f64::from(angle);
            for length in [1e-20, 1.0, 3e4] {
                #[expect(clippy::cast_possible_truncation, reason = "the argument is f32")]
                let (x, y) = ((length * exact.cos()) as f32, (length * exact.sin()) as f32);
                let expected = f64::from(y).atan2(f64::from(x));
                let error = (f64::from(atan2(y, x)) - expected).abs();
                assert!(error < 4e-7, "{x} {y}: {} instead of {expected}", atan2(y, x));
            }
        }
        assert_eq!(atan2(0.0, 0.0), 0.0);
        assert_eq!(atan2(0.0, -1.0), PI);
        assert_eq!(atan2(1.0, 0.0), FRAC_PI_2);
        assert_eq!(atan2(-2.0, 0.0), -FRAC_PI_2);
        assert!(atan2(f32::NAN, 1.0).is_nan());
    }

    #[test]
    fn sine_and_cosine_are_within_their_error_bounds() {
        for (low, high) in [(-8.0, 8.0), (-8192.0, 8192.0)] {
            check(low, high, |x| sin_cos(x).0, f64::sin, |_, _| 2e-7);
            check(low, high, |x| sin_cos(x).1, f64::cos, |_, _| 2e-7);
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }
}
