//! Settings of the filter, and their valid ranges.

use std::ops::RangeInclusive;

use super::DenoiseError;

/// Largest search radius in pixels.
pub const MAX_SEARCH: u32 = 16;

/// Valid patch radii in pixels.
pub const PATCHES: RangeInclusive<u32> = 1..=2;

/// Valid values of `k` and of tolerances: their squares stay far from the limits of single precision.
pub const TOLERANCES: RangeInclusive<f32> = 1e-4..=1e4;

/// Settings of the filter. A tolerance is a difference of pixels at which the weight falls to 1/e, approximately.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DenoiseSettings {
    /// Search radius in pixels: a pixel is replaced by a mean of `(2 search + 1)^2` pixels.
    pub search: u32,
    /// Patch radius in pixels: colours are compared by `(2 patch + 1)^2` pixels.
    pub patch: u32,
    /// Tolerance of colours, relative to the noise: larger is smoother.
    pub k: f32,
    /// Part of the colour distance within a half that limits the weights of the same half, 0 to 1: at 0, weights come
    /// from the other half only.
    pub own: f32,
    /// Tolerance of albedo, linear RGB.
    pub albedo: f32,
    /// Tolerance of normals, as the distance of unit vectors.
    pub normal: f32,
    /// Tolerance of depth, relative to the change that the local slope explains.
    pub depth: f32,
}

impl DenoiseSettings {
    /// For opaque surfaces. Tuned on path-traced pictures of a dam break with 4, 8 and 16 samples per pixel.
    pub const OPAQUE: Self = Self {
        search: 5,
        patch: 1,
        k: 0.45,
        own: 0.3,
        albedo: 0.06,
        normal: 0.25,
        depth: 3.0,
    };

    /// For water and other transmissive surfaces: no feature describes what is behind the surface, and a larger `k`
    /// looks waxy. Tuned on path-traced pictures of a dam break of water with 4 and 16 samples per pixel.
    pub const WATER: Self = Self {
        search: 4,
        k: 0.35,
        albedo: 0.2,
        ..Self::OPAQUE
    };

    /// Checks that all values are in their ranges.
    pub(super) fn validate(&self) -> Result<(), DenoiseError> {
        for (name, value, range) in [
            ("search", self.search, [0, MAX_SEARCH]),
            ("patch", self.patch, [*PATCHES.start(), *PATCHES.end()]),
        ] {
            if !(range[0]..=range[1]).contains(&value) {
                return Err(DenoiseError::Radius { name, value, range });
            }
        }
        let tolerances = [*TOLERANCES.start(), *TOLERANCES.end()];
        for (name, value, range) in [
            ("k", self.k, tolerances),
            ("own", self.own, [0.0, 1.0]),
            ("albedo", self.albedo, tolerances),
            ("normal", self.normal, tolerances),
            ("depth", self.depth, tolerances),
        ] {
            if !(range[0]..=range[1]).contains(&value) {
                return Err(DenoiseError::Tolerance { name, value, range });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_named() {
        let valid = DenoiseSettings::OPAQUE;
        assert_eq!(valid.validate(), Ok(()));
        assert_eq!(DenoiseSettings::WATER.validate(), Ok(()));
        let no_search = DenoiseSettings { search: 0, ..valid };
        assert_eq!(no_search.validate(), Ok(()));
        for (settings, message) in [
            (
                DenoiseSettings { search: 17, ..valid },
                "search = 17 is out of range, it must lie in 0 to 16",
            ),
            (
                DenoiseSettings { patch: 0, ..valid },
                "patch = 0 is out of range, it must lie in 1 to 2",
            ),
            (
                DenoiseSettings { k: 0.0, ..valid },
                "k = 0 is out of range, it must lie in 0.0001 to 10000",
            ),
            (
                DenoiseSettings { own: 1.5, ..valid },
                "own = 1.5 is out of range, it must lie in 0 to 1",
            ),
            (
                DenoiseSettings {
                    normal: f32::NAN,
                    ..valid
                },
                "normal = NaN is out of range, it must lie in 0.0001 to 10000",
            ),
        ] {
            assert_eq!(settings.validate().unwrap_err().to_string(), message);
        }
    }
}
