//! The planes of a tile of the image and of the border around it that its pixels are compared with, in memory that
//! stays in the cache.
//!
//! Coordinates are relative to the tile. A row stores its planes one after another. Pixels beside the image repeat
//! those at its edge, so that patches are complete; their red albedo is [`OUTSIDE`], so that their weight is 0.

use super::{
    DenoiseInput, DenoiseSettings,
    gather::{MISSED, OUTSIDE, Shares, UNUSABLE, classify, feature, halves, noise, slopes},
};
use crate::math::{LANES, Supported};

/// Planes of a row: the even half without albedo, three components.
pub(super) const EVEN: usize = 0;
/// The odd half.
pub(super) const ODD: usize = 3;
/// Albedo in units of its tolerance, three components.
pub(super) const ALBEDO: usize = 6;
/// Normal in units of its tolerance, three components.
pub(super) const NORMAL: usize = 9;
/// Distance along the view axis, or [`MISSED`].
pub(super) const DEPTH: usize = 12;
/// Variance of a pixel by the difference of its halves.
const VARIANCE: usize = 13;
/// Variance of one half, averaged over neighbours: the sum over its components. This plane and those after it are
/// derived from those before it.
pub(super) const NOISE: usize = 14;
/// Tolerance of depth per column.
pub(super) const SLOPE_X: usize = 15;
/// Tolerance of depth per row.
pub(super) const SLOPE_Y: usize = 16;
const PLANES: usize = 17;
/// Pixels from a plane of a row to the next: an odd number of cache lines, so that planes do not compete for the same
/// sets of the cache. A constant, so that kernels address all planes by one register.
pub(super) const STRIDE: usize = 176;

/// Neighbours on each side over which variances are averaged.
pub(super) const NOISE_RADIUS: usize = 1;
/// Pixels along a side of that square.
pub(super) const NOISE_SIDE: usize = 2 * NOISE_RADIUS + 1;

/// A rectangle of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rectangle {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Sizes that all tiles of an image have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct TileLayout {
    /// Pixels around a tile.
    pub(super) margin: usize,
    /// Number of pairs of pixels per row.
    pub(super) pairs: usize,
    /// Number of pixels per row that are compared: the patches of all pairs.
    pub(super) compared: usize,
}

impl TileLayout {
    /// For tiles of up to `width` columns.
    pub(super) fn new(settings: &DenoiseSettings, width: usize) -> Self {
        let (search, patch) = (settings.search as usize, settings.patch as usize);
        let pairs = (width + search).next_multiple_of(LANES);
        let compared = (width + search + 2 * patch).next_multiple_of(LANES);
        let margin = search + patch + NOISE_RADIUS;
        assert!(margin + pairs.max(compared - patch) < STRIDE);
        Self {
            margin,
            pairs,
            compared,
        }
    }

    /// The index of column `x` in a plane.
    pub(super) fn column(&self, x: isize) -> usize {
        index(self.margin, x)
    }
}

/// The index of `position` in an array that starts `margin` before position 0.
fn index(margin: usize, position: isize) -> usize {
    let index = margin.checked_add_signed(position);
    index.expect("positions lie within the margin")
}

/// The planes of a tile.
#[derive(Debug, Default)]
pub(super) struct Tile {
    values: Vec<f32>,
    margin: usize,
    row_len: usize,
    /// One value for each pixel of a row.
    buffer: Vec<f32>,
}

impl Tile {
    /// Values of all planes of row `y`.
    pub(super) fn row(&self, y: isize) -> &[f32] {
        &self.values[index(self.margin, y) * self.row_len..][..self.row_len]
    }

    /// Fills the planes for the tile at `place`.
    pub(super) fn gather(
        &mut self,
        simd: Supported,
        input: &DenoiseInput<'_>,
        settings: &DenoiseSettings,
        layout: &TileLayout,
        place: &Rectangle,
    ) {
        // Make room
        self.margin = layout.margin;
        self.row_len = PLANES * STRIDE;
        let rows = place.height + 2 * layout.margin;
        self.values.resize(rows * self.row_len, 0.0);
        self.buffer.resize(STRIDE, 0.0);
        // Copy the rows of the image
        let line = Line {
            simd,
            input,
            settings,
            layout,
            left: place.left,
        };
        for (number, row) in self.values.chunks_mut(self.row_len).enumerate() {
            line.copy(place.top + number, row, &mut self.buffer);
        }
        // Derive noise and slopes from neighbouring rows
        for number in NOISE_RADIUS..rows - NOISE_RADIUS {
            self.derive(&line, number);
        }
    }

    /// Computes noise and slopes in row `number`, except in the first and last column.
    fn derive(&mut self, line: &Line<'_>, number: usize) {
        const { assert!(NOISE_RADIUS == 1, "the rows above and below") };
        let len = self.row_len;
        let (before, rest) = self.values.split_at_mut(number * len);
        let (row, after) = rest.split_at_mut(len);
        let (row, derived) = row.split_at_mut(NOISE * STRIDE);
        let (above, below) = (&before[(number - 1) * len..], &after[..len]);
        let inner = 1..STRIDE - 1;
        // Average variances
        let colors: [&[f32]; 6] = std::array::from_fn(|c| &plane(row, EVEN + c)[inner.clone()]);
        let variance = [above, row, below].map(|row| plane(row, VARIANCE));
        let albedo = &plane(row, ALBEDO + 1)[inner.clone()];
        let [noise_plane, slope_x, slope_y] = planes_mut(derived, inner.clone());
        noise(line.simd, &variance, &colors, albedo, &mut self.buffer, noise_plane);
        // Compute slopes
        let [above, below] = [above, below].map(|row| &plane(row, DEPTH)[inner.clone()]);
        let unit = line.settings.depth;
        slopes(line.simd, unit, plane(row, DEPTH), above, below, slope_x, slope_y);
    }
}

/// All values of a plane in `row`.
fn plane(row: &[f32], plane: usize) -> &[f32] {
    &row[plane * STRIDE..][..STRIDE]
}

/// The pixels in `range` of each of the planes in `row`.
fn planes_mut<const N: usize>(
    row: &mut [f32],
    range: std::ops::Range<usize>,
) -> [&mut [f32]; N] {
    let mut planes = row.chunks_mut(STRIDE);
    std::array::from_fn(|_| {
        let plane = planes.next().expect("the row has this many planes");
        &mut plane[range.clone()]
    })
}

/// How rows of the image are copied to a tile.
struct Line<'a> {
    simd: Supported,
    input: &'a DenoiseInput<'a>,
    settings: &'a DenoiseSettings,
    layout: &'a TileLayout,
    /// The first column of the tile in the image.
    left: usize,
}

impl Line<'_> {
    /// Copies the row `margin` above row `below` of the image to `row`.
    fn copy(&self, below: usize, row: &mut [f32], usable: &mut [f32]) {
        let margin = self.layout.margin;
        let (width, height) = (self.input.width as usize, self.input.height as usize);
        let y = below.saturating_sub(margin).min(height - 1);
        let is_inside = y + margin == below;
        // Copy the columns inside the image
        let start = margin.saturating_sub(self.left);
        let first = self.left.saturating_sub(margin);
        let end = STRIDE.min(start + width - first);
        let pixels = y * width + first..y * width + first + end - start;
        self.copy_pixels(pixels, row, start..end, usable);
        // Repeat the columns at the edge of the image
        for (number, plane) in row.chunks_mut(STRIDE).take(NOISE).enumerate() {
            let outside = match number {
                ALBEDO => Some(OUTSIDE),
                DEPTH => Some(MISSED),
                _ => None,
            };
            let (left, right) = (plane[start], plane[end - 1]);
            plane[..start].fill(outside.unwrap_or(left));
            plane[end..].fill(outside.unwrap_or(right));
            if let (false, Some(outside)) = (is_inside, outside) {
                plane.fill(outside);
            }
        }
    }

    /// Copies `pixels` of the image to columns `to` of `row`.
    fn copy_pixels(
        &self,
        pixels: std::ops::Range<usize>,
        row: &mut [f32],
        to: std::ops::Range<usize>,
        usable: &mut [f32],
    ) {
        let (simd, input) = (self.simd, self.input);
        let shares = Shares::of(input.samples);
        let color = &input.color[pixels.clone()];
        let [odd, albedo, normal] = [input.odd, input.albedo, input.normal]
            .map(|plane| bytemuck::cast_slice(&plane[pixels.clone()]));
        let depth = &input.depth[pixels];
        let usable = &mut usable[to.clone()];
        let planes: [_; NOISE] = planes_mut(row, to);
        let [er, eg, eb, or, og, ob, ar, ag, ab, nx, ny, nz, z, variance] = planes;
        classify(simd, color, odd, albedo, normal, depth, usable, z);
        variance.fill(0.0);
        for (axis, (even, odd_plane)) in [(er, or), (eg, og), (eb, ob)].into_iter().enumerate() {
            halves(
                simd, axis, shares, color, odd, albedo, depth, usable, even, odd_plane, variance,
            );
        }
        let unit = 1.0 / self.settings.albedo;
        for (axis, plane) in [ar, ag, ab].into_iter().enumerate() {
            feature(simd, axis, unit, UNUSABLE, albedo, usable, plane);
        }
        let unit = 1.0 / self.settings.normal;
        for (axis, plane) in [nx, ny, nz].into_iter().enumerate() {
            feature(simd, axis, unit, 0.0, normal, usable, plane);
        }
    }
}
