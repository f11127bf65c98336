//! Filters one tile.
//!
//! The weight of two pixels is the same in both directions, so each pair of pixels is compared once, for half of the
//! offsets. Rows are taken from the top. For each offset the colour distances of a row are summed along the row and
//! kept until those of a whole patch are there; then the weights of the row in the middle are applied to the sums of
//! both pixels. All sums are in an order that does not depend on the tile.

use super::gather::{Shares, finish};
use super::kernels::{PairScale, covered_pairs, distances, pairs};
use super::planes::{STRIDE, SUMS};
use super::settings::{PATCH_RADIUS, PATCH_SIDE};
use super::tile::Tile;
use super::tiling::{Rectangle, TileLayout};
use super::{DenoiseInput, DenoiseSettings};
use spherule_tree::math::Supported;

/// Values of a row of sums.
const SUMS_LEN: usize = SUMS * STRIDE;
/// Values of the colour distances in the rows of a patch, for both halves.
const DISTANCES_LEN: usize = PATCH_SIDE * 2 * STRIDE;

/// The filter for an image, and the memory of one thread.
pub(super) struct TileFilter<'a> {
    simd: Supported,
    input: &'a DenoiseInput<'a>,
    /// See [`super::glints`].
    limits: &'a [f32],
    search: isize,
    /// Factor of the sum of colour distances over a patch.
    color_scale: f32,
    layout: TileLayout,
    offsets: Vec<Offset>,
    tile: Tile,
    /// Sums of rows for the first and the second pixel of pairs; the last row is for pixels beside the tile.
    sums: [Vec<f32>; 2],
    /// For each offset, the colour distances in the last rows.
    distances: Vec<f32>,
    /// Distances of single pixels, for each half.
    pixels: Vec<f32>,
}

/// Rows and columns from a pixel to the other one of a pair.
#[derive(Debug, Clone, Copy)]
struct Offset {
    dy: isize,
    dx: isize,
}

impl Offset {
    /// Those of the pixels after a pixel: to the right of it, and in the rows below.
    fn all(search: isize) -> Vec<Self> {
        let rows = (0..=search).flat_map(|dy| (-search..=search).map(move |dx| (dy, dx)));
        let after = rows.filter(|offset| *offset > (0, 0));
        let mut all = Vec::with_capacity(Self::count(search as usize));
        all.extend(after.map(|(dy, dx)| Self { dy, dx }));
        all
    }

    /// The number of all.
    const fn count(search: usize) -> usize {
        2 * search * (search + 1)
    }

    /// The first column of the pairs that have at least one pixel in the tile, for each of the two pixels.
    fn first_columns(self) -> [isize; 2] {
        [(-self.dx).min(0), self.dx.min(0)]
    }
}

impl<'a> TileFilter<'a> {
    /// For tiles of up to `columns` x `rows` pixels.
    pub(super) fn new(
        simd: Supported,
        (input, limits): (&'a DenoiseInput<'a>, &'a [f32]),
        settings: &DenoiseSettings,
        [columns, rows]: [usize; 2],
    ) -> Self {
        // Memory for the largest tile and all offsets of the search is allocated once
        let search = settings.search as usize;
        let layout = TileLayout::new(search, columns);
        let offsets = Offset::all(search as isize);
        let sums = || vec![0.0; (rows + 1) * SUMS_LEN];
        Self {
            simd,
            input,
            limits,
            search: search as isize,
            color_scale: settings.color_scale(),
            layout,
            tile: Tile::new(layout, rows),
            sums: [sums(), sums()],
            distances: vec![0.0; offsets.len() * DISTANCES_LEN],
            pixels: vec![0.0; 2 * STRIDE],
            offsets,
        }
    }

    /// The memory that [`Self::new`] allocates for tiles of up to `rows` rows, bytes.
    pub(super) fn bytes(search: usize, rows: usize) -> usize {
        let offsets = Offset::count(search);
        let sums = 2 * (rows + 1) * SUMS_LEN;
        let values = Tile::len(search, rows) + sums + offsets * DISTANCES_LEN + 2 * STRIDE;
        values * size_of::<f32>() + offsets * size_of::<Offset>()
    }

    /// Filters the pixels at `place` into `rows`.
    pub(super) fn filter(&mut self, place: &Rectangle, rows: &mut [&mut [[f32; 4]]]) {
        let image = (self.input, self.limits);
        self.tile.gather(self.simd, image, place);
        for sums in &mut self.sums {
            sums.fill(0.0);
        }
        // Compare and accumulate
        let patch = PATCH_RADIUS as isize;
        let height = place.height as isize;
        for last in -self.search - patch..height + patch {
            // The last row of a patch completes it
            let middle = last - patch;
            for number in 0..self.offsets.len() {
                let first = -self.offsets[number].dy;
                if last >= first - patch {
                    self.compare(place, number, last);
                }
                if middle >= first && middle < height {
                    self.accumulate(number, middle, height);
                }
            }
        }
        for (y, row) in rows.iter_mut().enumerate() {
            self.finish(place, y, row);
        }
    }

    /// Computes the colour distances of row `y` at offset `number`.
    fn compare(&mut self, place: &Rectangle, number: usize, y: isize) {
        let offset = self.offsets[number];
        let [p_first, q_first] =
            offset.first_columns().map(|x| self.layout.column(x - PATCH_RADIUS as isize));
        // The slot depends on the image and not on the tile, and so does the order of the sum over slots
        let slot = (place.top as isize + y).rem_euclid(PATCH_SIDE as isize) as usize;
        let sums = &mut self.distances[number * DISTANCES_LEN + slot * 2 * STRIDE..][..2 * STRIDE];
        let p = &self.tile.row(y)[p_first..];
        let q = &self.tile.row(y + offset.dy)[q_first..];
        let TileLayout { pairs, compared, .. } = self.layout;
        distances(self.simd, p, q, compared, pairs, &mut self.pixels, sums);
    }

    /// Adds to the sums of the pairs in row `y` at offset `number`.
    fn accumulate(&mut self, number: usize, y: isize, height: isize) {
        let offset = self.offsets[number];
        let [p_first, q_first] = offset.first_columns().map(|x| self.layout.column(x));
        let p = &self.tile.row(y)[p_first..];
        let q = &self.tile.row(y + offset.dy)[q_first..];
        let distances = &self.distances[number * DISTANCES_LEN..][..DISTANCES_LEN];
        let scale = PairScale {
            color: self.color_scale,
            columns: offset.dx.unsigned_abs() as f32,
            rows: offset.dy as f32,
        };
        let [p_row, q_row] = [y, y + offset.dy].map(|y| {
            let row = if (0..height).contains(&y) { y } else { height };
            row as usize * SUMS_LEN
        });
        let [p_sums, q_sums] = &mut self.sums;
        let p_sums = &mut p_sums[p_row + p_first..];
        let q_sums = &mut q_sums[q_row + q_first..];
        let count = self.layout.pairs;
        let accumulate = if self.input.is_transparent { covered_pairs } else { pairs };
        accumulate(self.simd, p, q, count, &scale, distances, p_sums, q_sums);
    }

    /// Writes row `y` of the tile at `place`.
    fn finish(&self, place: &Rectangle, y: usize, filtered: &mut [[f32; 4]]) {
        let start = (place.top + y) * self.input.width as usize + place.left;
        let pixels = start..start + place.width;
        let first = y * SUMS_LEN + self.layout.column(0);
        let [p, q] = [0, 1].map(|i| &self.sums[i][first..]);
        finish(
            self.simd,
            (Shares::of(self.input.samples), self.input.is_transparent),
            &self.input.color[pixels.clone()],
            bytemuck::cast_slice(&self.input.albedo[pixels.clone()]),
            &self.input.depth[pixels],
            p,
            q,
            filtered,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_a_thread_is_what_it_allocates() {
        let input = DenoiseInput {
            views: [1, 1],
            width: 0,
            height: 0,
            samples: 2,
            is_transparent: false,
            color: &[],
            odd: &[],
            albedo: &[],
            normal: &[],
            depth: &[],
        };
        for (search, rows) in [(1, 1), (4, 64), (16, 64)] {
            let settings = DenoiseSettings { search, k: 1.0 };
            let filter =
                TileFilter::new(Supported::default(), (&input, &[]), &settings, [16, rows]);
            let [p, q] = &filter.sums;
            let values = [p, q, &filter.distances, &filter.pixels].map(Vec::capacity);
            let floats = values.iter().sum::<usize>() + filter.tile.capacity();
            let offsets = filter.offsets.capacity() * size_of::<Offset>();
            let held = floats * size_of::<f32>() + offsets;
            assert_eq!(TileFilter::bytes(search as usize, rows), held, "{search} {rows}");
        }
    }
}
