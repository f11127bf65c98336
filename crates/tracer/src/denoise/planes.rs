//! The layout of rows in memory: planes one after another, [`STRIDE`] values each.
//!
//! A [`window`] has all planes of a row at 16 consecutive pixels: one check of bounds, then constant distances.

use spherule_tree::math::LANES;

/// Pixels from a plane of a row to the next: an odd number of cache lines, so that planes do not compete for the same
/// sets of the cache. A constant, so that kernels address all planes by one register.
pub(super) const STRIDE: usize = 176;

/// Planes of a row of pixels: the even half without albedo, three components.
pub(super) const EVEN: usize = 0;
/// The odd half.
pub(super) const ODD: usize = 3;
/// Albedo in units of its tolerance, three components.
pub(super) const ALBEDO: usize = 6;
/// Normal in units of its tolerance, three components.
pub(super) const NORMAL: usize = 9;
/// Distance along the view axis, the same for all missed pixels.
pub(super) const DEPTH: usize = 12;
/// Coverage of the even half, then of the odd one; only of pictures with a transparent background.
pub(super) const COVERAGE: usize = 13;
/// Variance of a pixel by the difference of its halves.
pub(super) const VARIANCE: usize = 15;
/// Variance of one half, averaged over neighbours: the sum over its components. This plane and those after it are
/// derived from those before it.
pub(super) const NOISE: usize = 16;
/// Tolerance of depth per column.
pub(super) const SLOPE_X: usize = 17;
/// Tolerance of depth per row.
pub(super) const SLOPE_Y: usize = 18;
/// Number of planes of a row of pixels.
pub(super) const PLANES: usize = 19;

/// Planes of a row of sums: three components of weighted differences for each half, then the weights of each half, and
/// the differences of their coverage.
pub(super) const SUMS: usize = 10;
/// The first plane with weights.
pub(super) const WEIGHTS: usize = 6;
/// The first plane with differences of coverage.
pub(super) const COVERAGE_SUMS: usize = 8;

/// A window of the planes of pixels.
pub(super) type Pixels = [f32; window_len(PLANES)];
/// A window of the planes of sums.
pub(super) type Sums = [f32; window_len(SUMS)];
/// A window of two planes, one for each half.
pub(super) type Halves = [f32; window_len(2)];

/// Values of a [`window`] of a row with `planes` planes.
pub(super) const fn window_len(planes: usize) -> usize {
    (planes - 1) * STRIDE + LANES
}

/// The values from `x` on.
#[inline(always)]
pub(super) fn window<const N: usize>(row: &[f32], x: usize) -> &[f32; N] {
    let window = row[x..].first_chunk();
    window.expect("rows are long enough")
}

/// The values from `x` on.
#[inline(always)]
pub(super) fn window_mut<const N: usize>(row: &mut [f32], x: usize) -> &mut [f32; N] {
    let window = row[x..].first_chunk_mut();
    window.expect("rows are long enough")
}
