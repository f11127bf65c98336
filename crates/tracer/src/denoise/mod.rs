//! Removes the noise of rendered pictures: dual-buffer non-local means with features.
//!
//! After F. Rousselle, C. Knaus and M. Zwicker, "Adaptive rendering with non-local means filtering" (2012), section
//! 4, with the features of their "Robust denoising using feature and color information" (2013). A pixel `p` is
//! replaced by a weighted mean of the pixels `q` of a search window. The samples are in two halves, even and odd, and
//! the weights of one half come from the other one, so that they do not depend on the noise that they average:
//!
//! - Colours are divided by albedo, so that textures stay sharp.
//! - The noise `v(p)` of a half is half the squared difference of the two halves, averaged over 5x5 pixels with the
//!   weights 1, 2, 3, 2, 1 on each axis.
//! - Two pixels of a half differ by `(|p - q|^2 - 2 min(v(p), v(q))) / (v(p) + v(q))`, at most 64. Two patches of 3x3
//!   pixels differ by the mean `d` over their pixels, divided by `k^2`.
//! - The feature distance `f` is the largest of the squared distances of albedo, normal and depth, each relative to its
//!   tolerance. The tolerance of depth grows with its slopes, so a plane that the camera sees at an angle is one
//!   surface.
//! - The weight is `(1 - x/8)^8`, close to `exp(-x)`, of the larger of `d` and `f`: the lesser of two weights.
//!
//! Two things differ from the paper. Its variance term is `v(p) + min(v(p), v(q))`; the one above is symmetric, so that
//! a pair of pixels is compared once for both. And `d` is that of the other half, but at least 0.3 times that of the
//! half itself. Otherwise a bright sample that the other half does not have is spread over the window: the error of
//! water with 16 samples rose from 3.4 to 4.8 of 255, and is 3.3 this way.
//!
//! A pixel that is more than 4 times as bright as all but 3 of its 24 neighbours, or 8 times as bright as all but 7, is
//! limited to that when it is filtered; the rest of its light stays where it is. Otherwise glints of a sun become squares
//! as large as the window.
//!
//! On a transparent background, pixels are compared as they are over white, and their coverage is averaged with the weights
//! of the colour: a shadow there is coverage without colour. Coverage by surfaces stays as it is.
//!
//! The result is the colour of the input plus the filtered change, so pixels without a similar neighbour keep their
//! bits. Pixels with NaN or infinite values keep theirs, and no other pixel receives them.
//!
//! Tiles with their border are copied to planes that stay in the cache, and are filtered row by row. The result does
//! not depend on threads, tiles or the instruction set. `docs/measurements/speed.md` has times and errors.

use glam::Vec3;
use rayon::prelude::*;
use thiserror::Error;

use spherule_tree::math::{SimdLevel, Supported};

pub mod device;
mod filter;
mod gather;
mod glints;
mod kernels;
mod planes;
mod settings;
mod tile;
mod tiling;

#[cfg(test)]
mod brute;
#[cfg(test)]
mod tests;

pub use settings::{COLOR_TOLERANCES, DenoiseSettings, SEARCH_RADII};

use filter::TileFilter;
use tiling::{TileLayout, equal_part, tiles, tiles_bytes};

/// Rows of a tile. Its border is filtered again by its neighbours, so more rows are less work in total, but need more
/// of the cache; 48 to 96 are equally fast.
const TILE_ROWS: usize = 64;

/// A picture and its features. All planes have `width * height` values, row by row.
#[derive(Debug, Clone, Copy)]
pub struct DenoiseInput<'a> {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of views beside each other and below each other, of equal size, as of the eyes of a stereo pair. Each is
    /// filtered as a picture of its own.
    pub views: [u32; 2],
    /// Samples per pixel, at least 2.
    pub samples: u32,
    /// Whether the background is transparent: coverage without an intersection is that of shadows, and is averaged
    /// with the weights of colours. Otherwise coverage is ignored, and stays.
    pub is_transparent: bool,
    /// Mean of all samples: linear RGB and coverage.
    pub color: &'a [[f32; 4]],
    /// Mean of the samples 1, 3, 5 and so on: linear RGB and coverage.
    pub odd: &'a [[f32; 4]],
    /// Base colour, linear RGB.
    pub albedo: &'a [Vec3],
    /// Unit normal, or zero.
    pub normal: &'a [Vec3],
    /// Distance along the view axis; infinite without an intersection.
    pub depth: &'a [f32],
}

/// Reasons why a picture cannot be filtered.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum DenoiseError {
    /// There are no two halves.
    #[error(
        "a picture with 1 sample per pixel cannot be denoised, as noise is measured by the difference of two \
         samples; use at least 2"
    )]
    OneSample,
    /// A plane does not match the size of the picture.
    #[error("the plane {plane} has {len} pixels, the picture has {width}x{height}")]
    Length {
        /// The plane.
        plane: &'static str,
        /// Its length.
        len: usize,
        /// Width of the picture in pixels.
        width: u32,
        /// Height of the picture in pixels.
        height: u32,
    },
    /// A setting is out of range.
    #[error(
        "search radius {search} is out of range, it must lie in {} to {}",
        SEARCH_RADII.start(),
        SEARCH_RADII.end()
    )]
    SearchRadius {
        /// The radius in pixels.
        search: u32,
    },
    /// A setting is out of range.
    #[error(
        "k = {k} is out of range, it must lie in {} to {}",
        COLOR_TOLERANCES.start(),
        COLOR_TOLERANCES.end()
    )]
    ColorTolerance {
        /// The tolerance of colours.
        k: f32,
    },
}

impl DenoiseInput<'_> {
    fn validate(&self) -> Result<(), DenoiseError> {
        let (width, height) = (self.width, self.height);
        let wanted = u64::from(width) * u64::from(height);
        for (plane, len) in [
            ("color", self.color.len()),
            ("odd", self.odd.len()),
            ("albedo", self.albedo.len()),
            ("normal", self.normal.len()),
            ("depth", self.depth.len()),
        ] {
            if len as u64 != wanted {
                return Err(DenoiseError::Length { plane, len, width, height });
            }
        }
        Ok(())
    }

    /// Width and height of a view.
    fn view(&self) -> [usize; 2] {
        let part = |length: u32, views: u32| length.div_ceil(views.max(1)) as usize;
        [part(self.width, self.views[0]), part(self.height, self.views[1])]
    }
}

/// Returns the filtered linear RGB and coverage of a picture. Runs on the current rayon pool.
///
/// # Errors
/// If a setting is out of range, if a plane has the wrong length, or if there is only one sample per pixel.
pub fn denoise(
    input: &DenoiseInput<'_>,
    settings: &DenoiseSettings,
) -> Result<Vec<[f32; 4]>, DenoiseError> {
    denoise_with(input, settings, &Execution::default())
}

/// Upper bound of the memory that filtering needs in addition to the input, of one view or two, bytes: the result,
/// brightness and limits, and the tiles of `threads` threads.
pub fn predicted_bytes(width: u32, height: u32, settings: &DenoiseSettings, threads: u64) -> u64 {
    let search = settings.search.min(*SEARCH_RADII.end()) as usize;
    let result = u64::from(width)
        * u64::from(height)
        * (size_of::<[f32; 4]>() + 2 * size_of::<f32>()) as u64;
    let tiles = tiles_bytes(width, height, TileLayout::max_width(search), TILE_ROWS);
    result + tiles + threads * TileFilter::bytes(search, TILE_ROWS) as u64
}

/// How a picture is filtered; the result does not depend on it.
#[derive(Debug, Clone, Copy)]
struct Execution {
    simd: SimdLevel,
    /// Largest width and height of a tile in pixels, at least 1.
    tile: [usize; 2],
}

impl Default for Execution {
    fn default() -> Self {
        Self { simd: SimdLevel::best(), tile: [usize::MAX, TILE_ROWS] }
    }
}

/// See [`denoise`].
fn denoise_with(
    input: &DenoiseInput<'_>,
    settings: &DenoiseSettings,
    execution: &Execution,
) -> Result<Vec<[f32; 4]>, DenoiseError> {
    settings.validate(input.samples)?;
    input.validate()?;
    let mut filtered = vec![[0.0; 4]; input.color.len()];
    if filtered.is_empty() {
        return Ok(filtered);
    }
    let limits = glints::limits(input);
    // Divide each view into equal tiles
    let width = input.width as usize;
    let [max_width, max_height] = execution.tile;
    let max_width = max_width.min(TileLayout::max_width(settings.search as usize));
    let view = input.view();
    let columns = equal_part(view[0], max_width);
    let rows = equal_part(view[1], max_height);
    let tiles = tiles(&mut filtered, width, view, [columns, rows]);
    // Filter them in parallel
    let simd = Supported::or_best(execution.simd);
    let filter = || TileFilter::new(simd, (input, &limits), settings, [columns, rows]);
    tiles.into_par_iter().for_each_init(filter, |filter, (place, mut rows)| {
        filter.filter(&place, &mut rows);
    });
    Ok(filtered)
}
