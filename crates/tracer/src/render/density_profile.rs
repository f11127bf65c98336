//! How the density of a medium varies along a ray: it is constant, or grows or falls exponentially, as that of mist does
//! with the height (`mist.rs`). Optical depths and free paths have closed forms.

use spherule_tree::math::functions::{exp, ln};

/// Below this size of the exponent, the series of the closed forms are more exact than the forms themselves.
const SMALL: f32 = 0.01;

/// The density of a medium at a distance `s`, relative to that of its coefficients: `density * exp(-rate * s)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DensityProfile {
    /// The density where the ray enters the medium.
    pub(super) density: f32,
    /// Per length; negative if the density grows.
    pub(super) rate: f32,
}

impl DensityProfile {
    pub(super) const CONSTANT: Self = Self { density: 1.0, rate: 0.0 };

    /// The length with the density 1 that has the same optical depth as a `length` of this profile: the integral of the
    /// density.
    pub(super) fn equal_length(self, length: f32) -> f32 {
        let Self { density, rate } = self;
        if rate == 0.0 {
            return density * length;
        }
        let exponent = rate * length;
        if exponent.abs() < SMALL {
            let series = 1.0 - exponent * (0.5 - exponent * (1.0 / 6.0 - exponent / 24.0));
            return density * length * series;
        }
        density * (1.0 - exp(-exponent)) / rate
    }

    /// The length of this profile that has the same optical depth as a length `equal` with the density 1; infinite if
    /// there is none. The inverse of [`Self::equal_length`].
    pub(super) fn length_of(self, equal: f32) -> f32 {
        let Self { density, rate } = self;
        let local = equal / density;
        if rate == 0.0 {
            return local;
        }
        let ratio = rate * local;
        if ratio.abs() < SMALL {
            // The series of -ln(1 - x) / x
            let series = 1.0 + ratio * (0.5 + ratio * (1.0 / 3.0 + 0.25 * ratio));
            return local * series;
        }
        if ratio >= 1.0 { f32::INFINITY } else { -ln(1.0 - ratio) / rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral of the density by the midpoint rule, in double precision.
    fn by_hand(profile: DensityProfile, length: f64) -> f64 {
        let steps = 20_000;
        let [density, rate] = [profile.density, profile.rate].map(f64::from);
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(steps) * length;
        let sum: f64 = (0..steps).map(|i| (-rate * at(i)).exp()).sum();
        density * sum * length / f64::from(steps)
    }

    const PROFILES: [(f32, f32); 9] = [
        (1.0, 0.0),
        (0.3, 1e-6),
        (0.3, -1e-6),
        (1.0, 0.02),
        (0.7, -0.02),
        (1.0, 3.0),
        (1e-6, -4.0),
        (0.5, 0.7),
        (2e-5, -2.0),
    ];

    #[test]
    fn optical_depths_are_integrals_of_the_density() {
        for (density, rate) in PROFILES {
            let profile = DensityProfile { density, rate };
            for length in [1e-3_f32, 0.1, 0.5, 1.0, 3.0] {
                let (found, expected) =
                    (f64::from(profile.equal_length(length)), by_hand(profile, f64::from(length)));
                let error = (found / expected - 1.0).abs();
                assert!(error < 2e-5, "{profile:?} {length}: {found} {expected}");
            }
            assert_eq!(profile.equal_length(0.0), 0.0);
        }
        // What rises out of the medium has a finite depth
        let rising = DensityProfile { density: 0.5, rate: 2.0 };
        assert_eq!(rising.equal_length(f32::INFINITY), 0.25);
        assert_eq!(DensityProfile::CONSTANT.equal_length(f32::INFINITY), f32::INFINITY);
    }

    #[test]
    fn lengths_are_the_inverse_of_optical_depths() {
        for (density, rate) in PROFILES {
            let profile = DensityProfile { density, rate };
            for length in [1e-3_f32, 0.1, 0.5, 1.0, 3.0] {
                let found = profile.length_of(profile.equal_length(length));
                // Far up, little of the depth is left to tell lengths apart
                let limit = 2e-5 * (rate * length).exp().max(1.0);
                assert!((found / length - 1.0).abs() < limit, "{profile:?} {length}: {found}");
            }
        }
        let rising = DensityProfile { density: 0.5, rate: 2.0 };
        for equal in [0.25, 0.3, 1e30, f32::INFINITY] {
            assert_eq!(rising.length_of(equal), f32::INFINITY);
        }
    }

    #[test]
    fn extreme_profiles_have_no_nan() {
        let extremes = [0.0, 1e-38, 1e-30, 1e-5, 1.0, 1e5, 1e30, f32::MAX];
        for density in [1e-28, 1e-10, 1.0] {
            for rate in extremes.into_iter().flat_map(|rate| [rate, -rate]) {
                for length in extremes {
                    let profile = DensityProfile { density, rate };
                    let (equal, back) = (profile.equal_length(length), profile.length_of(length));
                    assert!(equal >= 0.0 && back >= 0.0, "{profile:?} {length}: {equal} {back}");
                }
            }
        }
    }
}
