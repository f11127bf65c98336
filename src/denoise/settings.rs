//! Settings of the filter, and their valid ranges.

use super::DenoiseError;

/// Largest search radius in pixels.
pub const MAX_SEARCH: u32 = 16;

/// Largest patch radius in pixels.
pub const MAX_PATCH: u32 = 3;

/// Settings of the filter. Tolerances are differences of a feature at which the weight of a pixel falls to 1/e.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DenoiseSettings {
    /// Search radius in pixels: a pixel is replaced by a mean over `(2 search + 1)^2` pixels.
    pub search: u32,
    /// Patch radius in pixels: colours are compared over `(2 patch + 1)^2` pixels.
    pub patch: u32,
    /// Damping of colour distances, relative to the noise: larger is smoother.
    pub k: f32,
    pub own: f32,
    /// Tolerance of albedo, linear RGB.
    pub albedo: f32,
    /// Tolerance of normals, as the distance of unit vectors.
    pub normal: f32,
    /// Tolerance of depth, relative to the change that the local slope explains.
    pub depth: f32,
}

impl DenoiseSettings {
    /// For opaque surfaces. Tuned on path-traced pictures of a dam break with 4 to 16 samples.
    pub const OPAQUE: Self = Self {
        search: 5,
        patch: 1,
        k: 0.45,
        own: 0.5,
        albedo: 0.06,
        normal: 0.25,
        depth: 3.0,
    };

    /// For water and other transmissive surfaces, where a larger `k` looks waxy.
    pub const WATER: Self = Self {
        search: 4,
        patch: 1,
        k: 0.35,
        albedo: 0.2,
        ..Self::OPAQUE
    };

    pub(super) fn validate(&self) -> Result<(), DenoiseError> {
        for (name, value, max) in [
            ("search", self.search, MAX_SEARCH),
            ("patch", self.patch, MAX_PATCH),
        ] {
            if value > max {
                return Err(DenoiseError::Radius { name, value, max });
            }
        }
        for (name, value) in [
            ("k", self.k),
            ("albedo", self.albedo),
            ("normal", self.normal),
            ("depth", self.depth),
        ] {
            if !TOLERANCES.contains(&value) {
                return Err(DenoiseError::Tolerance { name, value });
            }
        }
        Ok(())
    }
}

/// Valid values of `k` and of tolerances; their squares and reciprocals stay far from the limits of f32.
pub(super) const TOLERANCES: std::ops::RangeInclusive<f32> = 1e-4..=1e4;
