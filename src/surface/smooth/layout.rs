//! The lengths of a smooth surface.

use std::ops::RangeInclusive;

use super::brick::VOXELS;
use crate::surface::SurfaceSettings;
use crate::surface::field::bins::floor;

/// Standard deviation of the blur of crowded particles at smoothing 1, in particle radii.
const WIDEST: f32 = 2.0;
/// The blur ends at so many standard deviations, within the bricks beside.
const BLUR_REACH: f32 = 2.7;
const LONGEST_BLUR: i32 = 6;
/// Blurring lowers the field at convex places, so the threshold goes down with it: by this part at
/// smoothing 1. Tuned against splashsurf's smoothed mesh.
const LOWERED: f32 = 1.0 / 9.0;
/// Thresholds below this may be met farther than half the support from any particle: the part of the kernel
/// beyond that is 0.37.
const NEAR_THRESHOLD: f32 = 0.45;

/// Lengths in scene units unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    /// Of a particle.
    pub(super) radius: f32,
    /// Edge of a voxel.
    pub(super) voxel: f32,
    /// Of the kernel.
    pub(super) support: f32,
    /// Value of the field at the surface.
    pub(super) threshold: f32,
    /// Standard deviation of the blur, in voxels; 0 is none.
    pub(super) sigma: f32,
    /// Distance at which the blur ends, in voxels.
    pub(super) blur: i32,
}

impl Layout {
    pub(super) fn new(settings: &SurfaceSettings, radius: f32) -> Self {
        let smoothing = if settings.exact {
            0.0
        } else {
            settings.smoothing
        };
        let sigma = WIDEST * smoothing / settings.voxel;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "settings are checked: below 30"
        )]
        let blur = ((BLUR_REACH * sigma).round() as i32).min(LONGEST_BLUR);
        Self {
            radius,
            voxel: settings.voxel * radius,
            support: 2.0 * settings.smoothing_length * radius,
            threshold: settings.threshold * (1.0 - LOWERED * smoothing),
            sigma: if blur > 0 { sigma } else { 0.0 },
            blur,
        }
    }

    /// The bricks along an axis in which the particles of a bin may make a surface.
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
