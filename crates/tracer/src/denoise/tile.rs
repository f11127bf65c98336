//! The planes of a tile of the image and of the border around it that its pixels are compared with, in memory that
//! stays in the cache.
//!
//! Pixels beside the view repeat those at its edge, so that patches are complete; their red albedo is [`OUTSIDE`], so
//! that their weight is 0.

use std::ops::Range;

use super::DenoiseInput;
use super::gather::{
    MISSED, OUTSIDE, Shares, UNUSABLE, classify, coverages, feature, halves, noise, slopes,
};
use super::planes::{ALBEDO, DEPTH, EVEN, NOISE, PLANES, STRIDE, VARIANCE};
use super::settings::{ALBEDO_TOLERANCE, NORMAL_TOLERANCE};
use super::tiling::{NOISE_RADIUS, Rectangle, TileLayout};
use spherule_tree::math::Supported;

/// Values of a row of pixels.
const ROW_LEN: usize = PLANES * STRIDE;

/// The planes of a tile. Rows and columns are relative to the tile.
#[derive(Debug)]
pub(super) struct Tile {
    values: Vec<f32>,
    layout: TileLayout,
    /// One value for each pixel of a row.
    buffer: Vec<f32>,
}

impl Tile {
    /// For tiles of up to `rows` rows.
    pub(super) fn new(layout: TileLayout, rows: usize) -> Self {
        Self {
            values: vec![0.0; (rows + 2 * layout.margin) * ROW_LEN],
            layout,
            buffer: vec![0.0; STRIDE],
        }
    }

    /// Number of values that [`Self::new`] allocates.
    pub(super) const fn len(search: usize, rows: usize) -> usize {
        (rows + 2 * TileLayout::margin(search)) * ROW_LEN + STRIDE
    }

    #[cfg(test)]
    pub(super) fn capacity(&self) -> usize {
        self.values.capacity() + self.buffer.capacity()
    }

    /// Values of all planes of row `y`.
    pub(super) fn row(&self, y: isize) -> &[f32] {
        &self.values[self.layout.row(y) * ROW_LEN..][..ROW_LEN]
    }

    /// Fills the planes for the tile at `place`; `limits` are those of all pixels of `input`.
    pub(super) fn gather(
        &mut self,
        simd: Supported,
        (input, limits): (&DenoiseInput<'_>, &[f32]),
        place: &Rectangle,
    ) {
        let margin = self.layout.margin;
        let rows = place.height + 2 * margin;
        // Copy the rows of the image
        let line = Line { simd, input, limits, margin, view: View::around(input, place) };
        for (number, row) in self.values.chunks_mut(ROW_LEN).take(rows).enumerate() {
            line.copy(number, place, row, &mut self.buffer);
        }
        // Derive noise and slopes from neighbouring rows
        for number in NOISE_RADIUS..rows - NOISE_RADIUS {
            self.derive(simd, number);
        }
    }

    /// Computes noise and slopes in row `number` of those in memory, except in the first and last columns.
    fn derive(&mut self, simd: Supported, number: usize) {
        const { assert!(NOISE_RADIUS == 2, "two rows above and below") };
        let (before, rest) = self.values.split_at_mut(number * ROW_LEN);
        let (row, below) = rest.split_at_mut(ROW_LEN);
        let (row, derived) = row.split_at_mut(NOISE * STRIDE);
        let above = |rows: usize| &before[(number - rows) * ROW_LEN..];
        let below = |rows: usize| &below[(rows - 1) * ROW_LEN..];
        let inner = NOISE_RADIUS..STRIDE - NOISE_RADIUS;
        let [noise_plane, slope_x, slope_y] = planes_mut(derived, inner.clone());
        // Average variances
        let colors: [&[f32]; 6] = std::array::from_fn(|c| &plane(row, EVEN + c)[inner.clone()]);
        let variance =
            [above(2), above(1), row, below(1), below(2)].map(|row| plane(row, VARIANCE));
        let albedo = &plane(row, ALBEDO + 1)[inner.clone()];
        noise(simd, &variance, &colors, albedo, &mut self.buffer, noise_plane);
        // Compute slopes; those of the first column need its left neighbour
        let depth = &plane(row, DEPTH)[inner.start - 1..];
        let [above, below] = [above(1), below(1)].map(|row| &plane(row, DEPTH)[inner.clone()]);
        slopes(simd, depth, above, below, slope_x, slope_y);
    }
}

/// All values of a plane in `row`.
fn plane(row: &[f32], plane: usize) -> &[f32] {
    &row[plane * STRIDE..][..STRIDE]
}

/// The pixels in `range` of each of the planes in `row`.
fn planes_mut<const N: usize>(row: &mut [f32], range: Range<usize>) -> [&mut [f32]; N] {
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
    limits: &'a [f32],
    /// Pixels around the tile.
    margin: usize,
    view: View,
}

/// The first and the last column and row of a view, which are its edges.
struct View {
    columns: [usize; 2],
    rows: [usize; 2],
}

impl View {
    /// The view that contains a tile.
    fn around(input: &DenoiseInput<'_>, tile: &Rectangle) -> Self {
        let ends = |start: usize, length: usize, of_image: u32| {
            let first = start / length * length;
            [first, (first + length).min(of_image as usize) - 1]
        };
        let [width, height] = input.view();
        Self {
            columns: ends(tile.left, width, input.width),
            rows: ends(tile.top, height, input.height),
        }
    }
}

impl Line<'_> {
    /// Copies row `number` of those of the `tile` and its margin to `row`.
    fn copy(&self, number: usize, tile: &Rectangle, row: &mut [f32], usable: &mut [f32]) {
        let (margin, [top, bottom]) = (self.margin, self.view.rows);
        let width = self.input.width as usize;
        let below = tile.top + number;
        let y = below.saturating_sub(margin).clamp(top, bottom);
        let is_inside = y + margin == below;
        // Copy the columns inside the view
        let [leftmost, rightmost] = self.view.columns;
        let left = tile.left - leftmost;
        let start = margin.saturating_sub(left);
        let first = leftmost + left.saturating_sub(margin);
        let end = STRIDE.min(start + rightmost + 1 - first);
        let pixels = y * width + first..y * width + first + end - start;
        self.copy_pixels(pixels, row, start..end, usable);
        // Repeat the columns at the edge of the view
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
        pixels: Range<usize>,
        row: &mut [f32],
        to: Range<usize>,
        usable: &mut [f32],
    ) {
        // Take the pixels from all planes of the image
        let (simd, input) = (self.simd, self.input);
        let shares = Shares::of(input.samples);
        let (color, odd) = (&input.color[pixels.clone()], &input.odd[pixels.clone()]);
        let is_transparent = input.is_transparent;
        let [albedo, normal] =
            [input.albedo, input.normal].map(|plane| bytemuck::cast_slice(&plane[pixels.clone()]));
        let (depth, limits) = (&input.depth[pixels.clone()], &self.limits[pixels]);
        // Find the columns of the tile that they go to
        let usable = &mut usable[to.clone()];
        let planes: [_; NOISE] = planes_mut(row, to);
        let [er, eg, eb, or, og, ob, ar, ag, ab, nx, ny, nz, z, ea, oa, variance] = planes;
        // Find the pixels that can be compared
        classify(simd, is_transparent, color, odd, albedo, normal, depth, usable, z);
        // Compute both halves and their variance, axis by axis
        variance.fill(0.0);
        for (axis, (even, odd_plane)) in [(er, or), (eg, og), (eb, ob)].into_iter().enumerate() {
            halves(
                simd,
                axis,
                (shares, is_transparent),
                color,
                odd,
                albedo,
                depth,
                usable,
                limits,
                even,
                odd_plane,
                variance,
            );
        }
        if is_transparent {
            coverages(simd, shares, color, odd, usable, ea, oa);
        }
        // Scale features so that a difference of 1 is the tolerance
        for (axis, plane) in [ar, ag, ab].into_iter().enumerate() {
            let unit = 1.0 / ALBEDO_TOLERANCE;
            feature(simd, axis, unit, UNUSABLE, albedo, usable, plane);
        }
        for (axis, plane) in [nx, ny, nz].into_iter().enumerate() {
            let unit = 1.0 / NORMAL_TOLERANCE;
            feature(simd, axis, unit, 0.0, normal, usable, plane);
        }
    }
}
