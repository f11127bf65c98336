//! Planes of a row of a tile from those of the image: halves without albedo, noise, features in units of their
//! tolerances, and slopes of depth. Compiled for each instruction set.

use super::planes::{COVERAGE_SUMS, EVEN, ODD, STRIDE, WEIGHTS};
use super::settings::SLOPE_TOLERANCE;
use super::tiling::{NOISE_RADIUS, NOISE_SIDE};
use spherule_tree::math::{lane_kernel, larger, smaller};

/// Depth of pixels without an intersection: far from that of all others.
pub(super) const MISSED: f32 = 1e18;
/// Albedo of a pixel that gives its colour to no other: far from that of all others, so that its weight is 0.
pub(super) const UNUSABLE: f32 = 1e18;
/// Red albedo of a pixel beside the image, which gives its colour to no other either.
pub(super) const OUTSIDE: f32 = 2e18;
/// Depths of intersections; others count as missed.
pub(super) const DEPTHS: [f32; 2] = [1e-15, 1e15];
/// Larger values count as infinite: their squares would overflow.
pub(super) const MAX_VALUE: f32 = 1e14;
/// Colours are divided by albedo, but by no less than this.
pub(super) const MIN_ALBEDO: f32 = 0.02;
/// Noise of an unusable pixel: large, so that patches that contain it are compared by their other pixels.
pub(super) const UNUSABLE_NOISE: f32 = 1e30;
/// Noise that is always assumed, relative to the colour: it decides where there is none.
pub(super) const RELATIVE_NOISE: f32 = 1e-3;
/// Weights of variances on each axis: those of 3x3 pixels averaged twice. Over 3x3 pixels the estimate was so uncertain
/// that large surfaces kept 10 % more error.
pub(super) const NOISE_WEIGHTS: [f32; NOISE_SIDE] = [1.0, 2.0, 3.0, 2.0, 1.0];
/// The square of noise that is always assumed, so that black pixels can be compared.
pub(super) const MIN_NOISE: f32 = 1e-12;

/// Parts of the samples that are even and odd.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shares {
    pub(super) even: f32,
    pub(super) odd: f32,
}

impl Shares {
    /// Of at least 2 samples, counted from 0.
    pub(super) fn of(samples: u32) -> Self {
        let odd = (samples / 2) as f32 / samples as f32;
        Self { even: 1.0 - odd, odd }
    }
}

/// The colours that pixels are compared by. On a transparent background, where `depth` is no intersection, they are those
/// over white: the shadow there has no colour of its own.
#[inline(always)]
pub(super) fn compared(rgba: &[f32; 4], depth: f32, is_transparent: bool) -> [f32; 3] {
    let [r, g, b, coverage] = *rgba;
    let behind = if is_transparent & !is_depth(depth) { 1.0 - coverage } else { 0.0 };
    [r + behind, g + behind, b + behind]
}

/// Whether `depth` is that of an intersection.
#[inline(always)]
#[expect(clippy::manual_range_contains, reason = "both comparisons without a branch")]
fn is_depth(depth: f32) -> bool {
    (depth >= DEPTHS[0]) & (depth <= DEPTHS[1])
}

/// What a component of colours is divided by before they are filtered.
#[inline(always)]
pub(super) fn divisor(albedo: f32, depth: f32) -> f32 {
    let albedo = smaller(larger(albedo, MIN_ALBEDO), MAX_VALUE);
    if is_depth(depth) { albedo } else { 1.0 }
}

/// The sum of the magnitudes of `values`.
#[inline(always)]
fn magnitude(values: &[f32; 3]) -> f32 {
    values[0].abs() + values[1].abs() + values[2].abs()
}

/// Whether a pixel of these values can be filtered: all of them are finite, and their squares.
#[inline(always)]
pub(super) fn is_usable(
    color: &[f32; 3],
    odd: &[f32; 3],
    albedo: &[f32; 3],
    normal: &[f32; 3],
) -> bool {
    let color = magnitude(color) + magnitude(odd);
    let feature = magnitude(albedo) + magnitude(normal);
    color + feature <= MAX_VALUE
}

/// Stores 1 for pixels that can be filtered, otherwise 0; and depths, with one value for all missed pixels.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "see `math::lane_kernel`")]
fn classify_body(
    is_transparent: bool,
    color: &[[f32; 4]],
    odd: &[[f32; 4]],
    albedo: &[[f32; 3]],
    normal: &[[f32; 3]],
    depth: &[f32],
    usable: &mut [f32],
    depth_plane: &mut [f32],
) {
    let count = color.len();
    let (odd, albedo, normal) = (&odd[..count], &albedo[..count], &normal[..count]);
    let (depth, usable) = (&depth[..count], &mut usable[..count]);
    let depth_plane = &mut depth_plane[..count];
    for x in 0..count {
        let (color, odd) = (
            compared(&color[x], depth[x], is_transparent),
            compared(&odd[x], depth[x], is_transparent),
        );
        usable[x] = if is_usable(&color, &odd, &albedo[x], &normal[x]) { 1.0 } else { 0.0 };
        depth_plane[x] = if is_depth(depth[x]) { depth[x] } else { MISSED };
    }
}

lane_kernel! {
    pub(super) fn classify(
        is_transparent: bool, color: &[[f32; 4]], odd: &[[f32; 4]], albedo: &[[f32; 3]], normal: &[[f32; 3]],
        depth: &[f32], usable: &mut [f32], depth_plane: &mut [f32],
    ) = classify_body;
}

/// Computes component `axis` of both halves of a row, divided by albedo and within `limits`, and adds the variance of a
/// half by the difference of the two. All of it is 0 where a pixel is not usable.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "see `math::lane_kernel`")]
fn halves_body(
    axis: usize,
    (shares, is_transparent): (Shares, bool),
    color: &[[f32; 4]],
    odd: &[[f32; 4]],
    albedo: &[[f32; 3]],
    depth: &[f32],
    usable: &[f32],
    limits: &[f32],
    even_plane: &mut [f32],
    odd_plane: &mut [f32],
    variance: &mut [f32],
) {
    // Slices of one length, so that the loop needs no bounds checks
    let count = color.len();
    let (odd, albedo) = (&odd[..count], &albedo[..count]);
    let (depth, usable, limits) = (&depth[..count], &usable[..count], &limits[..count]);
    let (even_plane, odd_plane) = (&mut even_plane[..count], &mut odd_plane[..count]);
    let variance = &mut variance[..count];
    let to_even = 1.0 / shares.even;
    for x in 0..count {
        // Divide both halves by albedo; the even half is what the odd one leaves of the mean
        let scale = 1.0 / divisor(albedo[x][axis], depth[x]);
        let odd = compared(&odd[x], depth[x], is_transparent)[axis];
        let even =
            (compared(&color[x], depth[x], is_transparent)[axis] - odd * shares.odd) * to_even;
        // Limit them; pixels that are not usable are 0
        let is_usable = usable[x] > 0.0;
        let limit = limits[x];
        let even = larger(smaller(even * scale, limit), -limit);
        let odd = larger(smaller(odd * scale, limit), -limit);
        let even = if is_usable { even } else { 0.0 };
        let odd = if is_usable { odd } else { 0.0 };
        // The difference of the halves estimates the variance
        even_plane[x] = even;
        odd_plane[x] = odd;
        variance[x] += 0.5 * (even - odd) * (even - odd);
    }
}

lane_kernel! {
    pub(super) fn halves(
        axis: usize, how: (Shares, bool), color: &[[f32; 4]], odd: &[[f32; 4]], albedo: &[[f32; 3]], depth: &[f32],
        usable: &[f32], limits: &[f32], even_plane: &mut [f32], odd_plane: &mut [f32], variance: &mut [f32],
    ) = halves_body;
}

/// Computes the coverage of both halves of a row, 0 where a pixel is not usable.
#[inline(always)]
fn coverages_body(
    shares: Shares,
    color: &[[f32; 4]],
    odd: &[[f32; 4]],
    usable: &[f32],
    even_plane: &mut [f32],
    odd_plane: &mut [f32],
) {
    let count = color.len();
    let (odd, usable) = (&odd[..count], &usable[..count]);
    let (even_plane, odd_plane) = (&mut even_plane[..count], &mut odd_plane[..count]);
    let to_even = 1.0 / shares.even;
    for x in 0..count {
        let odd = odd[x][3];
        let even = (color[x][3] - odd * shares.odd) * to_even;
        let is_usable = usable[x] > 0.0;
        even_plane[x] = if is_usable { even } else { 0.0 };
        odd_plane[x] = if is_usable { odd } else { 0.0 };
    }
}

lane_kernel! {
    pub(super) fn coverages(
        shares: Shares, color: &[[f32; 4]], odd: &[[f32; 4]], usable: &[f32], even_plane: &mut [f32],
        odd_plane: &mut [f32],
    ) = coverages_body;
}

/// Computes component `axis` of a vector feature of a row: `values` times `unit`, or `otherwise` where a pixel is not
/// usable.
#[inline(always)]
fn feature_body(
    axis: usize,
    unit: f32,
    otherwise: f32,
    values: &[[f32; 3]],
    usable: &[f32],
    plane: &mut [f32],
) {
    let count = values.len();
    let (usable, plane) = (&usable[..count], &mut plane[..count]);
    for x in 0..count {
        let scaled = values[x][axis] * unit;
        plane[x] = if usable[x] > 0.0 { scaled } else { otherwise };
    }
}

lane_kernel! {
    pub(super) fn feature(
        axis: usize, unit: f32, otherwise: f32, values: &[[f32; 3]], usable: &[f32], plane: &mut [f32],
    ) = feature_body;
}

/// The sum of `values` with [`NOISE_WEIGHTS`].
#[inline(always)]
fn weighted(values: [f32; NOISE_SIDE]) -> f32 {
    let [a, b, c, d, e] = values;
    let [outer, inner, center, ..] = NOISE_WEIGHTS;
    outer * (a + e) + inner * (b + d) + center * c
}

/// The noise of a row of pixels: the mean variance of 5x5 neighbours with [`NOISE_WEIGHTS`], and a small part of the
/// colour. `variance` has the rows from the second above the pixels to the second below them, each from the second pixel
/// to the left of the first one on. `colors` has the planes of both halves; an albedo of [`UNUSABLE`] marks unusable
/// pixels.
#[inline(always)]
fn noise_body(
    variance: &[&[f32]; NOISE_SIDE],
    colors: &[&[f32]; 6],
    albedo: &[f32],
    column_sums: &mut [f32],
    noise: &mut [f32],
) {
    let count = noise.len();
    // Sum along columns
    let width = count + 2 * NOISE_RADIUS;
    let [a, b, c, d, e] = variance.map(
        #[inline(always)]
        |row| &row[..width],
    );
    let column_sums = &mut column_sums[..width];
    for x in 0..width {
        column_sums[x] = weighted([a[x], b[x], c[x], d[x], e[x]]);
    }
    // Sum along rows
    let sums: [&[f32]; NOISE_SIDE] = std::array::from_fn(
        #[inline(always)]
        |offset| &column_sums[offset..][..count],
    );
    let colors = colors.map(
        #[inline(always)]
        |plane| &plane[..count],
    );
    let albedo = &albedo[..count];
    for x in 0..count {
        let mut brightness = 0.0;
        for axis in 0..3 {
            let both = colors[axis][x] + colors[3 + axis][x];
            brightness += both * both;
        }
        let sum = weighted([sums[0][x], sums[1][x], sums[2][x], sums[3][x], sums[4][x]]);
        let mean = sum * (1.0 / 81.0);
        let least = brightness * (0.25 * RELATIVE_NOISE * RELATIVE_NOISE) + MIN_NOISE;
        let is_usable = albedo[x] < UNUSABLE;
        let estimate = smaller(mean + least, UNUSABLE_NOISE);
        noise[x] = if is_usable { estimate } else { UNUSABLE_NOISE };
    }
}

lane_kernel! {
    pub(super) fn noise(
        variance: &[&[f32]; NOISE_SIDE], colors: &[&[f32]; 6], albedo: &[f32], column_sums: &mut [f32], noise: &mut [f32],
    ) = noise_body;
}

/// The tolerance of depth per column and row, in proportion to the slope: on each axis the lesser of the differences
/// with the two neighbours, so that edges are not slopes; 0 if both are missed. `depth` begins at the left neighbour of
/// the first pixel, `above` and `below` at the pixel.
#[inline(always)]
fn slopes_body(
    depth: &[f32],
    above: &[f32],
    below: &[f32],
    slope_x: &mut [f32],
    slope_y: &mut [f32],
) {
    let count = slope_x.len();
    let (left, center, right) = (&depth[..count], &depth[1..][..count], &depth[2..][..count]);
    let (above, below) = (&above[..count], &below[..count]);
    let slope_y = &mut slope_y[..count];
    for x in 0..count {
        slope_x[x] = lesser_slope(left[x], center[x], right[x]) * SLOPE_TOLERANCE;
        slope_y[x] = lesser_slope(above[x], center[x], below[x]) * SLOPE_TOLERANCE;
    }
}

#[inline(always)]
fn lesser_slope(before: f32, at: f32, after: f32) -> f32 {
    let slope = smaller((at - before).abs(), (after - at).abs());
    if slope <= DEPTHS[1] { slope } else { 0.0 }
}

lane_kernel! {
    pub(super) fn slopes(
        depth: &[f32], above: &[f32], below: &[f32], slope_x: &mut [f32], slope_y: &mut [f32],
    ) = slopes_body;
}

/// Adds the change of a row to its colours. `p` and `q` are rows of sums, whose total counts. A component that was not
/// negative stays so. On a transparent background, the coverage by shadows changes, too, and stays in 0 to 1; that by surfaces
/// is exact.
#[inline(always)]
fn finish_body(
    (shares, is_transparent): (Shares, bool),
    color: &[[f32; 4]],
    albedo: &[[f32; 3]],
    depth: &[f32],
    p: &[f32],
    q: &[f32],
    filtered: &mut [[f32; 4]],
) {
    let count = color.len();
    let (albedo, depth) = (&albedo[..count], &depth[..count]);
    let filtered = &mut filtered[..count];
    let sum = |plane: usize, x: usize| p[plane * STRIDE + x] + q[plane * STRIDE + x];
    for x in 0..count {
        // The pixel itself has weight 1
        let even = shares.even / (1.0 + sum(WEIGHTS, x));
        let odd = shares.odd / (1.0 + sum(WEIGHTS + 1, x));
        let coverage = color[x][3];
        let mut covered = 0.0;
        if is_transparent & !is_depth(depth[x]) {
            covered = sum(COVERAGE_SUMS, x) * even + sum(COVERAGE_SUMS + 1, x) * odd;
            let changed = smaller(larger(coverage + covered, 0.0), 1.0);
            filtered[x][3] = if covered == 0.0 { coverage } else { changed };
        } else {
            filtered[x][3] = coverage;
        }
        for axis in 0..3 {
            let change = sum(EVEN + axis, x) * even + sum(ODD + axis, x) * odd;
            let value = color[x][axis];
            // Over white, what covers more also takes light away, which is not a change of the colour
            let changed = value + (divisor(albedo[x][axis], depth[x]) * change + covered);
            // Written such that NaN stays
            let least = smaller(value, 0.0);
            filtered[x][axis] = if changed < least { least } else { changed };
        }
    }
}

lane_kernel! {
    pub(super) fn finish(
        how: (Shares, bool), color: &[[f32; 4]], albedo: &[[f32; 3]], depth: &[f32], p: &[f32], q: &[f32],
        filtered: &mut [[f32; 4]],
    ) = finish_body;
}
