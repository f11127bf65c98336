//! Settings of the filter, their valid ranges, and the tolerances of features.
//!
//! All were tuned on path-traced pictures of a dam break, of spheres with 4, 8 and 16 samples per pixel and of water
//! with 4 and 16. A tolerance is a difference of pixels at which the weight falls to 1/e, approximately.

use std::ops::RangeInclusive;

use super::DenoiseError;

/// Valid search radii in pixels.
pub const SEARCH_RADII: RangeInclusive<u32> = 1..=16;
/// Valid values of [`DenoiseSettings::k`].
pub const COLOR_TOLERANCES: RangeInclusive<f32> = 1e-3..=1e3;

/// Patch radius in pixels: colours are compared by 3x3 pixels. 5x5 were no better.
pub(super) const PATCH_RADIUS: usize = 1;
/// Pixels along a side of a patch.
pub(super) const PATCH_SIDE: usize = 2 * PATCH_RADIUS + 1;
/// Part of the colour distance within a half that limits the weights of the same half.
pub(super) const OWN_PART: f32 = 0.3;
/// Tolerance of albedo, linear RGB.
pub(super) const ALBEDO_TOLERANCE: f32 = 0.1;
/// Tolerance of normals, as the distance of unit vectors.
pub(super) const NORMAL_TOLERANCE: f32 = 0.25;
/// Tolerance of depth, relative to the change that the local slope explains.
pub(super) const SLOPE_TOLERANCE: f32 = 3.0;
/// Tolerance of depth that is always allowed, relative to the depth.
pub(super) const DEPTH_TOLERANCE: f32 = 3e-3;

/// Settings of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DenoiseSettings {
    /// Search radius in pixels: a pixel is replaced by a mean of `(2 search + 1)^2` pixels.
    pub search: u32,
    /// Tolerance of colours, relative to the noise: larger is smoother.
    pub k: f32,
}

impl DenoiseSettings {
    /// For opaque surfaces.
    pub const OPAQUE: Self = Self { search: 4, k: 0.48 };

    /// For water and other transmissive surfaces: no feature describes what is behind the surface, so a larger `k`
    /// would blur it.
    pub const WATER: Self = Self { search: 4, k: 0.35 };

    /// Checks that all values are in their ranges, and that pictures of so many `samples` per pixel can be filtered.
    ///
    /// # Errors
    /// The first thing that is not so.
    pub fn validate(&self, samples: u32) -> Result<(), DenoiseError> {
        if samples < 2 {
            return Err(DenoiseError::OneSample);
        }
        let (search, k) = (self.search, self.k);
        if !SEARCH_RADII.contains(&search) {
            return Err(DenoiseError::SearchRadius { search });
        }
        if !COLOR_TOLERANCES.contains(&k) {
            return Err(DenoiseError::ColorTolerance { k });
        }
        Ok(())
    }
}
