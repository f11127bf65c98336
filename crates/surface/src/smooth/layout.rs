//! Lengths and thresholds of a smooth surface.

use std::ops::RangeInclusive;

use super::brick::VOXELS;
use crate::SurfaceSettings;
use crate::field::bins::floor;

/// Standard deviation of the blur of crowded particles at smoothing 1, in particle radii.
const MAX_SIGMA: f32 = 2.0;
/// Extent of the blur in standard deviations.
const BLUR_REACH: f32 = 2.7;
/// Maximum extent of the blur in voxels, so that it stays within the neighbouring bricks.
const MAX_BLUR: i32 = 6;
/// Blurring lowers the field at convex places, so the threshold is reduced by this fraction at smoothing 1. Tuned
/// against the smoothed mesh of splashsurf.
const THRESHOLD_REDUCTION: f32 = 1.0 / 9.0;
/// A surface with a lower threshold may be farther than half the support from all particles: the kernel is 0.37 there.
const NEAR_THRESHOLD: f32 = 0.45;

/// Lengths are in scene units unless noted otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    /// Radius of a particle.
    pub(super) radius: f32,
    /// Edge of a voxel.
    pub(super) voxel: f32,
    /// Support of the kernel.
    pub(super) support: f32,
    /// Value of the field at the surface.
    pub(super) threshold: f32,
    /// Standard deviation of the blur, in voxels; 0 without blur.
    pub(super) sigma: f32,
    /// Extent of the blur, in voxels.
    pub(super) blur: i32,
}

impl Layout {
    pub(super) fn new(settings: &SurfaceSettings, radius: f32) -> Self {
        let smoothing = if settings.exact { 0.0 } else { settings.smoothing };
        let sigma = MAX_SIGMA * smoothing / settings.voxel;
        #[expect(clippy::cast_possible_truncation, reason = "settings are checked: below 30")]
        let blur = ((BLUR_REACH * sigma).round() as i32).min(MAX_BLUR);
        Self {
            radius,
            voxel: settings.voxel * radius,
            support: 2.0 * settings.smoothing_length * radius,
            threshold: settings.threshold * (1.0 - THRESHOLD_REDUCTION * smoothing),
            sigma: if blur > 0 { sigma } else { 0.0 },
            blur,
        }
    }

    /// The bricks along an axis that may contain a surface of the particles of a bin.
    pub(super) fn bricks_near(&self, bin: i32) -> RangeInclusive<i32> {
        let reach = if self.threshold < NEAR_THRESHOLD {
            self.support + self.blur as f32 * self.voxel
        } else {
            0.5 * (self.support + self.sigma * self.voxel)
        };
        let edge = VOXELS as f32 * self.voxel;
        let low = (bin as f32 * self.support - reach) / edge;
        let high = ((bin + 1) as f32 * self.support + reach) / edge;
        floor(low)..=floor(high)
    }
}
