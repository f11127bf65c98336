//! Orthonormal frames around normals, and the mapping of the unit square to hemispheres.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use spherule_tree::math::functions::sin_cos;

/// Two unit vectors perpendicular to the unit vector `n` and to each other (Duff et al., "Building an orthonormal
/// basis, revisited", 2017).
#[inline(always)]
pub(in crate::render) fn tangents(n: [f32; 3]) -> [[f32; 3]; 2] {
    let sign = if n[2] < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + n[2]);
    let b = n[0] * n[1] * a;
    [[1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]], [b, sign + n[1] * n[1] * a, -n[1]]]
}

/// A point of the unit disc, uniform if `u` is uniform in the unit square; neighbours stay neighbours (Shirley and
/// Chiu, "A low distortion map between disk and square", 1997).
#[inline(always)]
pub(in crate::render) fn disc(u: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    let is_steep = b.abs() > a.abs();
    let (radius, other) = if is_steep { (b, a) } else { (a, b) };
    let part = if radius == 0.0 { 0.0 } else { other / radius };
    let angle = FRAC_PI_4 * part;
    let angle = if is_steep { FRAC_PI_2 - angle } else { angle };
    let (sin, cos) = sin_cos(angle);
    [radius * cos, radius * sin]
}

/// The vector with the components `local` along the tangents of `n` and `n`, normalised.
#[inline(always)]
pub(in crate::render) fn to_world(local: [f32; 3], n: [f32; 3]) -> [f32; 3] {
    let [s, t] = tangents(n);
    let mut world = [0.0; 3];
    for axis in 0..3 {
        world[axis] = local[0] * s[axis] + local[1] * t[axis] + local[2] * n[axis];
    }
    let length2 = world[0] * world[0] + world[1] * world[1] + world[2] * world[2];
    let inverse = 1.0 / length2.sqrt();
    [world[0] * inverse, world[1] * inverse, world[2] * inverse]
}

/// The direction at `u` in a cone around `axis`: `cap` is 1 minus the cosine of half its opening angle.
#[inline(always)]
pub(in crate::render) fn in_cone(axis: [f32; 3], cap: f32, u: [f32; 2]) -> [f32; 3] {
    let below = u[0] * cap;
    let level = (below * (2.0 - below)).sqrt();
    let (sin, cos) = sin_cos(2.0 * std::f32::consts::PI * u[1]);
    to_world([level * cos, level * sin, 1.0 - below], axis)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn frames_are_orthonormal() {
        for i in 0..755_u16 {
            let angle = f32::from(i) * 2.399_963;
            let z = 1.0 - f32::from(i) / 377.0;
            let z = z.clamp(-1.0, 1.0);
            let level = (1.0 - z * z).sqrt();
            let n = Vec3::new(level * angle.cos(), level * angle.sin(), z);
            let [s, t] = tangents(n.to_array()).map(Vec3::from_array);
            for (a, b, wanted) in [(s, s, 1.0), (t, t, 1.0), (s, t, 0.0), (s, n, 0.0), (t, n, 0.0)]
            {
                assert!((a.dot(b) - wanted).abs() < 1e-5, "{n}");
            }
            let world = Vec3::from_array(to_world([0.0, 0.0, 1.0], n.to_array()));
            assert!((world - n).length() < 1e-6);
        }
    }

    #[test]
    fn the_disc_is_filled_evenly() {
        let side = 200_u16;
        let (mut inner, mut moment) = (0, 0.0);
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            let unit = |k: u16| (f32::from(k) + 0.5) / f32::from(side);
            let [x, y] = disc([unit(i), unit(j)]);
            let radius2 = x * x + y * y;
            assert!(radius2 <= 1.0);
            inner += u32::from(radius2 < 0.25);
            moment += f64::from(x * x);
        }
        let count = f64::from(side).powi(2);
        assert!((f64::from(inner) / count - 0.25).abs() < 5e-3, "{inner}");
        assert!((moment / count - 0.25).abs() < 1e-3, "{moment}");
        assert_eq!(disc([0.5, 0.5]), [0.0, 0.0]);
    }
}
