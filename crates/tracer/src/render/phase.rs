//! The phase function of media: the distribution of the directions into which a scattering event deflects light, by
//! Henyey and Greenstein, "Diffuse radiation in the galaxy", 1941.

use std::f32::consts::PI;

use super::shading::to_world;
use glam::Vec3;
use spherule_tree::math::functions::sin_cos;

/// Anisotropy below which directions are sampled as for 0, whose limit the formula for others cannot reach.
const ISOTROPIC: f32 = 1e-3;

/// The part of the light that is deflected by an angle with this `cosine`, per steradian; `anisotropy` is the mean of the
/// cosine.
pub(super) fn henyey_greenstein(anisotropy: f32, cosine: f32) -> f32 {
    let g = anisotropy;
    let base = (1.0 + g * g - 2.0 * g * cosine).max(f32::MIN_POSITIVE);
    (1.0 - g * g) / (4.0 * PI * base * base.sqrt())
}

/// A direction that light from `direction` is deflected to, with the density [`henyey_greenstein`]. The phase function is
/// the same if light travels in reverse, so `direction` may be that of a path of the camera. `u` is uniform in the unit
/// square.
pub(super) fn sample_henyey_greenstein(anisotropy: f32, direction: Vec3, u: [f32; 2]) -> Vec3 {
    let g = anisotropy;
    let cosine = if g.abs() < ISOTROPIC {
        1.0 - 2.0 * u[0]
    } else {
        let root = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]);
        ((1.0 + g * g - root * root) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * u[1]);
    to_world([sine * cos, sine * sin, cosine], direction.to_array()).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a grid in the unit square.
    fn grid(side: u16) -> impl Iterator<Item = [f32; 2]> {
        let at = move |i: u16| (f32::from(i) + 0.5) / f32::from(side);
        (0..side).flat_map(move |x| (0..side).map(move |y| [at(x), at(y)]))
    }

    #[test]
    fn all_light_goes_somewhere_with_the_mean_cosine() {
        for g in [-0.95_f32, -0.4, 0.0, 0.0005, 0.3, 0.8, 0.95] {
            // The midpoint rule over the cosine
            let steps = 200_000;
            let (mut sum, mut mean) = (0.0_f64, 0.0_f64);
            for i in 0..steps {
                let cosine = 2.0 * (f64::from(i) + 0.5) / f64::from(steps) - 1.0;
                #[expect(clippy::cast_possible_truncation, reason = "a cosine")]
                let value = f64::from(henyey_greenstein(g, cosine as f32));
                let part = value * 4.0 * std::f64::consts::PI / f64::from(steps);
                sum += part;
                mean += part * cosine;
            }
            assert!((sum - 1.0).abs() < 1e-3, "{g}: {sum}");
            assert!((mean - f64::from(g)).abs() < 1e-3, "{g}: {mean}");
        }
    }

    #[test]
    fn directions_have_the_density_of_the_phase_function() {
        let along = Vec3::new(0.3, -0.5, 0.8).normalize();
        for g in [-0.7_f32, 0.0, 0.0005, 0.5, 0.9] {
            let mut counts = [0_u32; 8];
            let (mut sum, mut sideways) = (Vec3::ZERO, Vec3::ZERO);
            for u in grid(256) {
                let found = sample_henyey_greenstein(g, along, u);
                assert!((found.length() - 1.0).abs() < 1e-5);
                let cosine = found.dot(along);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "8")]
                let bin = ((cosine + 1.0) * 4.0).clamp(0.0, 7.0) as usize;
                counts[bin] += 1;
                sum += found;
                sideways += found - cosine * along;
            }
            assert!((sum.dot(along) / 65_536.0 - g).abs() < 2e-3, "{g}: {sum}");
            assert!(sideways.length() / 65_536.0 < 1e-3, "{g}");
            // The integral over each bin
            for (bin, count) in (0_u16..).zip(counts) {
                let steps = 2000_u16;
                let cosine =
                    |i: u16| (f32::from(bin) + (f32::from(i) + 0.5) / f32::from(steps)) / 4.0 - 1.0;
                let values = (0..steps).map(|i| henyey_greenstein(g, cosine(i)));
                let expected = values.sum::<f32>() * 2.0 * PI / 4.0 / f32::from(steps);
                #[expect(clippy::cast_precision_loss, reason = "small counts")]
                let found = count as f32 / 65_536.0;
                assert!((found - expected).abs() < 5e-3, "{g} {bin}: {found} {expected}");
            }
        }
    }
}
