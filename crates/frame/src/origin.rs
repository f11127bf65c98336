//! Chooses the world position that the f32 coordinates of a sequence are relative to.

use glam::DVec3;

/// Largest distance of the centre from zero, in diagonals, for which the origin stays at zero.
///
/// At a coordinate `c`, the spacing of f32 is at most `c * 2^-23`, so that a position is rounded by up to
/// `8 * 2^-24 = 2^-21` of the diagonal. With ten million particles (about 215 along an axis), this is a
/// ten-thousandth of the particle spacing. Data nearer to zero keeps its coordinates.
const NEAR: f64 = 8.0;

/// The origin for particles between `min` and `max` (world units).
///
/// The origin is zero on every axis on which the data is near zero. On other axes it is the centre, rounded to
/// a multiple of a power of two of about the diagonal's size. f32 coordinates there are multiples of a smaller
/// power of two, so that the subtraction is exact. Bounds that are empty or not finite give zero.
pub fn choose_origin(min: DVec3, max: DVec3) -> DVec3 {
    let valid = min.is_finite() && max.is_finite() && min.cmple(max).all();
    if !valid {
        return DVec3::ZERO;
    }
    let centre = min * 0.5 + max * 0.5;
    let diagonal = (max - min).length();
    let axis = |centre: f64| {
        if centre.abs() <= NEAR * diagonal {
            return 0.0;
        }
        let grid = power_below(diagonal).max(power_below(centre.abs()) * f64::from(f32::EPSILON));
        (centre / grid).round() * grid
    };
    DVec3::new(axis(centre.x), axis(centre.y), axis(centre.z))
}

/// The largest power of two that does not exceed `value`; 0 for 0.
fn power_below(value: f64) -> f64 {
    if value > 0.0 && value.is_finite() {
        // Clear the fraction. Subnormal numbers have exponent 0 and give zero.
        f64::from_bits(value.to_bits() & f64::INFINITY.to_bits())
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn near_data_keep_their_coordinates() {
        assert_eq!(
            choose_origin(DVec3::new(3.0, 5.0, -2.0), DVec3::new(7.0, 8.0, 2.0)),
            DVec3::ZERO
        );
        assert_eq!(choose_origin(DVec3::ZERO, DVec3::ZERO), DVec3::ZERO);
    }

    #[test]
    fn empty_bounds_have_a_zero_origin() {
        assert_eq!(choose_origin(DVec3::INFINITY, DVec3::NEG_INFINITY), DVec3::ZERO);
        assert_eq!(choose_origin(DVec3::NAN, DVec3::ONE), DVec3::ZERO);
        assert_eq!(choose_origin(DVec3::ONE, DVec3::ZERO), DVec3::ZERO);
    }

    #[test]
    fn far_f32_data_lose_nothing() {
        for (far, size) in [(1e6f32, 1.0f32), (-3.3e5, 700.0), (1e9, 4096.0)] {
            let min = Vec3::new(far, 0.0, -far);
            let max = min + Vec3::splat(size);
            let origin = choose_origin(min.as_dvec3(), max.as_dvec3());
            assert_eq!(origin.y, 0.0);
            assert!(origin.x != 0.0 && origin.z != 0.0);
            for step in 0..100u8 {
                let point = min + Vec3::splat(size * f32::from(step) / 100.0);
                let relative = (point.as_dvec3() - origin).as_vec3();
                assert_eq!(relative.as_dvec3() + origin, point.as_dvec3());
                assert!(relative.abs().max_element() <= 2.0 * size + 1e-3 * far.abs());
            }
        }
    }

    #[test]
    fn far_f64_data_keep_their_shape() {
        let min = DVec3::splat(1e6);
        let origin = choose_origin(min, min + DVec3::splat(1.0));
        let a = (min + DVec3::splat(0.001) - origin).as_vec3();
        let b = (min - origin).as_vec3();
        assert!(((a - b).x - 0.001).abs() < 1e-7);
    }
}
