//! Filters one tile.
//!
//! The weight of two pixels is the same in both directions, so each pair of pixels is compared once, for half of the
//! offsets. Rows are taken from the top. For each offset the colour distances of a row are summed along the row and
//! kept until those of a whole patch are there; then the weights of the row in the middle are applied to the sums of
//! both pixels. All sums are in an order that does not depend on the tile.

use glam::Vec3;

use super::{
    DenoiseInput, DenoiseSettings,
    gather::{Shares, finish},
    kernels::{SUMS, WeightScale, distances_3, distances_5, pairs_3, pairs_5},
    tile::{Rectangle, STRIDE, Tile, TileLayout},
};
use crate::math::Supported;

/// Tolerance of depth on a plane that faces the camera, relative to the depth.
const DEPTH_TOLERANCE: f32 = 3e-3;

/// The filter for an image, and the memory of one thread.
pub(super) struct TileFilter<'a> {
    simd: Supported,
    input: &'a DenoiseInput<'a>,
    settings: &'a DenoiseSettings,
    layout: TileLayout,
    /// Rows and columns from a pixel to the other one of a pair.
    offsets: Vec<(isize, isize)>,
    tile: Tile,
    /// Sums of rows for the first and the second pixel of pairs.
    sums: [Vec<f32>; 2],
    /// For each offset, the colour distances in the last rows: a plane for each half.
    distances: Vec<f32>,
    /// Distances of single pixels, for each half.
    row: [Vec<f32>; 2],
}

impl<'a> TileFilter<'a> {
    /// For tiles of up to `width` columns.
    pub(super) fn new(
        simd: Supported,
        input: &'a DenoiseInput<'a>,
        settings: &'a DenoiseSettings,
        width: usize,
    ) -> Self {
        let search = settings.search as isize;
        let offsets: Vec<_> = (0..=search)
            .flat_map(|dy| (-search..=search).map(move |dx| (dy, dx)))
            .filter(|offset| *offset > (0, 0))
            .collect();
        let rows = 2 * settings.patch as usize + 1;
        Self {
            simd,
            input,
            settings,
            layout: TileLayout::new(settings, width),
            tile: Tile::default(),
            sums: [Vec::new(), Vec::new()],
            distances: vec![0.0; offsets.len() * rows * 2 * STRIDE],
            row: [vec![0.0; STRIDE], vec![0.0; STRIDE]],
            offsets,
        }
    }

    /// Filters the pixels at `place` into `rows`.
    pub(super) fn filter(&mut self, place: &Rectangle, rows: &mut [&mut [Vec3]]) {
        self.tile
            .gather(self.simd, self.input, self.settings, &self.layout, place);
        // Compare and accumulate
        let search = self.settings.search as isize;
        let patch = self.settings.patch as isize;
        let height = place.height as isize;
        let sum_rows = place.height + 1;
        for sums in &mut self.sums {
            sums.clear();
            sums.resize(sum_rows * SUMS * STRIDE, 0.0);
        }
        for y in -search - patch..height + patch {
            for number in 0..self.offsets.len() {
                let (dy, _) = self.offsets[number];
                if y >= -dy - patch {
                    self.compare(place, number, y);
                }
            }
            for number in 0..self.offsets.len() {
                let (dy, _) = self.offsets[number];
                if y - patch >= -dy && y - patch < height {
                    self.add(number, y - patch, height);
                }
            }
        }
        // Finish
        for (y, row) in rows.iter_mut().enumerate() {
            self.finish(place, y, row);
        }
    }

    /// The first column of the pairs at column offset `dx`.
    fn first(dx: isize) -> isize {
        (-dx).min(0)
    }

    /// Computes the colour distances of row `y` at offset `number`.
    fn compare(&mut self, place: &Rectangle, number: usize, y: isize) {
        let (dy, dx) = self.offsets[number];
        let patch = self.settings.patch as isize;
        let rows = 2 * self.settings.patch as usize + 1;
        let TileLayout {
            pairs, compared, ..
        } = self.layout;
        // The slot depends on the image and not on the tile, and so does the order of the sum over slots
        let slot = number * rows + (place.top as isize + y).rem_euclid(rows as isize) as usize;
        let sums = &mut self.distances[slot * 2 * STRIDE..][..2 * STRIDE];
        let first = Self::first(dx) - patch;
        let p = &self.tile.row(y)[self.layout.column(first)..];
        let q = &self.tile.row(y + dy)[self.layout.column(first + dx)..];
        let [even, odd] = &mut self.row;
        match rows {
            3 => distances_3(self.simd, p, q, compared, pairs, even, odd, sums),
            _ => distances_5(self.simd, p, q, compared, pairs, even, odd, sums),
        }
    }

    /// Adds to the sums of the pairs in row `y` at offset `number`.
    fn add(&mut self, number: usize, y: isize, height: isize) {
        let (dy, dx) = self.offsets[number];
        let first = Self::first(dx);
        let (p_at, q_at) = (self.layout.column(first), self.layout.column(first + dx));
        let p = &self.tile.row(y)[p_at..];
        let q = &self.tile.row(y + dy)[q_at..];
        let rows = 2 * self.settings.patch as usize + 1;
        let len = rows * 2 * STRIDE;
        let distances = &self.distances[number * len..][..len];
        let scale = self.scale(dx, dy);
        let [p_row, q_row] = [y, y + dy].map(|y| {
            let row = if y < 0 || y >= height { height } else { y };
            row as usize * SUMS * STRIDE
        });
        let [p_sums, q_sums] = &mut self.sums;
        let p_sums = &mut p_sums[p_row + p_at..];
        let q_sums = &mut q_sums[q_row + q_at..];
        let (simd, count) = (self.simd, self.layout.pairs);
        match rows {
            3 => pairs_3(simd, p, q, count, &scale, distances, p_sums, q_sums),
            _ => pairs_5(simd, p, q, count, &scale, distances, p_sums, q_sums),
        }
    }

    fn scale(&self, dx: isize, dy: isize) -> WeightScale {
        let k = self.settings.k * self.settings.k;
        let side = 2.0 * self.settings.patch as f32 + 1.0;
        WeightScale {
            color: 1.0 / (k * side * side),
            own: self.settings.own,
            offset: [dx.unsigned_abs() as f32, dy as f32],
            depth: DEPTH_TOLERANCE,
        }
    }

    /// Writes row `y` of the tile at `place`.
    fn finish(&self, place: &Rectangle, y: usize, filtered: &mut [Vec3]) {
        let start = (place.top + y) * self.input.width as usize + place.left;
        let pixels = start..start + place.width;
        let first = self.layout.column(0);
        let row = y * SUMS * STRIDE + first;
        let [p, q] = [0, 1].map(|i| &self.sums[i][row..]);
        finish(
            self.simd,
            Shares::of(self.input.samples),
            &self.input.color[pixels.clone()],
            bytemuck::cast_slice(&self.input.albedo[pixels.clone()]),
            &self.input.depth[pixels],
            p,
            q,
            bytemuck::cast_slice_mut(filtered),
        );
    }
}
