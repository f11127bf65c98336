//! How to render: the settings of an image, their bounds, and the errors for settings out of bounds.

use thiserror::Error;

use super::film::Channels;
use crate::scene::{Material, MaterialError};

/// Most samples per pixel: more than any picture needs, and few enough to count in f32.
pub const MAX_SAMPLES: u32 = 4096;

/// Deepest recursion: a level takes some stack.
pub const MAX_DEPTH: u32 = 64;

/// Deepest recursion that follows both branches at transmissive spheres always: the rays double at each level.
pub const MAX_LITERAL_DEPTH: u32 = 8;

/// Path weight below which one of two branches is drawn, unless something else is asked for.
pub const DEFAULT_MIN_WEIGHT: f32 = 1.0 / 1024.0;

/// Path weights that can be asked for beside 0. A sample has at most `1 / min_weight` paths.
pub const MIN_WEIGHTS: std::ops::RangeInclusive<f32> = 1e-5..=1.0;

/// Longest side of an image in pixels.
pub const MAX_SIDE: u32 = 65_536;

/// How to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel; 1 looks through the pixel's centre exactly.
    pub samples: u32,
    /// 1 shades what the camera sees with direct light only; each level more follows reflections
    /// and refractions once more. Where it ends, a ray sees the background.
    pub max_depth: u32,
    /// Where a ray meets a transmissive sphere, both the reflected and the refracted branch are followed while
    /// each has a path weight (the product of the weights of its branches) of at least this; below, one of the
    /// two is drawn, with the weight of both. 0 follows both always: equation 4.1 to the letter, to
    /// [`MAX_LITERAL_DEPTH`]. Surfaces of one body have a rule of their own.
    pub min_weight: f32,
    /// Leaves the background out of the colour of pixels and fades the ground out in `A`; by
    /// default the background is in `RGB` where `A` is 0.
    pub transparent_background: bool,
    /// Planes to fill.
    pub channels: Channels,
    /// If given, the image is a mosaic: its tiles of 16x16 pixels are tiles of an image of this width and height, spread
    /// evenly over it. What a mosaic costs for each pixel, the whole image costs.
    pub mosaic_of: Option<[u32; 2]>,
}

impl RenderSettings {
    /// Depth 3 as in the thesis, one sample per pixel, colour only.
    pub const fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            samples: 1,
            max_depth: 3,
            min_weight: DEFAULT_MIN_WEIGHT,
            transparent_background: false,
            channels: Channels::COLOR,
            mosaic_of: None,
        }
    }

    /// Pixels across and down of the image that the camera sees.
    pub(super) fn full_size(&self) -> [u32; 2] {
        self.mosaic_of.unwrap_or([self.width, self.height])
    }

    pub(super) fn validate(&self) -> Result<(), RenderError> {
        let [full_width, full_height] = self.full_size();
        for (name, value, max) in [
            ("width", self.width, MAX_SIDE),
            ("height", self.height, MAX_SIDE),
            ("width", full_width, MAX_SIDE),
            ("height", full_height, MAX_SIDE),
            ("samples", self.samples, MAX_SAMPLES),
            ("max_depth", self.max_depth, MAX_DEPTH),
        ] {
            if !(1..=max).contains(&value) {
                return Err(RenderError::OutOfRange { name, value, max });
            }
        }
        if self.min_weight != 0.0 && !MIN_WEIGHTS.contains(&self.min_weight) {
            return Err(RenderError::MinWeight(self.min_weight));
        }
        Ok(())
    }

    /// Checks that the rays of spheres of `material` do not double at each level for too many levels.
    pub(super) fn validate_branches(&self, material: &Material) -> Result<(), RenderError> {
        let max_depth = self.max_depth;
        if self.min_weight == 0.0 && material.branches() && max_depth > MAX_LITERAL_DEPTH {
            return Err(RenderError::TooManyBranches { max_depth });
        }
        Ok(())
    }
}

/// Why there is no image.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RenderError {
    /// The caller asked to stop.
    #[error("rendering was interrupted")]
    Interrupted,
    /// A setting makes no image.
    #[error("{name} = {value} is out of range, it must lie in 1 to {max}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// What it was.
        value: u32,
        /// The largest that works.
        max: u32,
    },
    /// The path weight from which on one branch is drawn is out of range.
    #[error("min_weight = {0} is out of range, it must be 0 or lie in {low:e} to {high}", low = MIN_WEIGHTS.start(), high = MIN_WEIGHTS.end())]
    MinWeight(f32),
    /// Both branches are to be followed for too many levels.
    #[error(
        "min_weight = 0 follows both branches at transmissive spheres, which doubles the rays at each level; \
         max_depth = {max_depth} is too deep for that, it must be at most {MAX_LITERAL_DEPTH}"
    )]
    TooManyBranches {
        /// The depth.
        max_depth: u32,
    },
    /// A constant of the material is out of range.
    #[error(transparent)]
    Material(#[from] MaterialError),
}
