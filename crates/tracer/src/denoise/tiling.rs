//! How a picture is divided into tiles.

use super::planes::STRIDE;
use super::settings::PATCH_RADIUS;
use spherule_tree::math::LANES;

/// Neighbours on each side over which variances are averaged.
pub(super) const NOISE_RADIUS: usize = 2;
/// Pixels along a side of the square of these neighbours.
pub(super) const NOISE_SIDE: usize = 2 * NOISE_RADIUS + 1;

/// A rectangle of the image, in pixels.
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
    /// For tiles of up to `width` columns, at most [`Self::max_width`].
    pub(super) fn new(search: usize, width: usize) -> Self {
        debug_assert!(width <= Self::max_width(search));
        Self {
            margin: Self::margin(search),
            pairs: (width + search).next_multiple_of(LANES),
            compared: (width + search + 2 * PATCH_RADIUS).next_multiple_of(LANES),
        }
    }

    /// Pixels around a tile.
    pub(super) const fn margin(search: usize) -> usize {
        search + PATCH_RADIUS + NOISE_RADIUS
    }

    /// The largest width whose pixels, with those that they are compared with, fit into a row.
    pub(super) const fn max_width(search: usize) -> usize {
        let whole_groups = (STRIDE - 1 - Self::margin(search)) / LANES * LANES;
        whole_groups - search - 2 * PATCH_RADIUS
    }

    /// The index of column `x` in a plane.
    pub(super) fn column(&self, x: isize) -> usize {
        self.index(x)
    }

    /// The index of row `y` in a tile.
    pub(super) fn row(&self, y: isize) -> usize {
        self.index(y)
    }

    fn index(&self, position: isize) -> usize {
        let index = self.margin.checked_add_signed(position);
        index.expect("positions lie within the margin")
    }
}

/// The smallest length that divides `whole` into as many parts as parts of length `max` would.
pub(super) fn equal_part(whole: usize, max: usize) -> usize {
    whole.div_ceil(whole.div_ceil(max))
}

/// The place of a tile, and its rows.
type TileRows<'a> = (Rectangle, Vec<&'a mut [[f32; 4]]>);

/// Splits a plane of `width` columns with views of this size into tiles of up to `columns` x `rows` pixels, each in one
/// view.
pub(super) fn tiles(
    plane: &mut [[f32; 4]],
    width: usize,
    view: [usize; 2],
    [columns, rows]: [usize; 2],
) -> Vec<TileRows<'_>> {
    // Count the tiles
    let count = |length: usize, view: usize, part: usize| {
        length / view * view.div_ceil(part) + (length % view).div_ceil(part)
    };
    let height = plane.len() / width;
    let tiles = count(width, view[0], columns) * count(height, view[1], rows);
    let mut all = Vec::with_capacity(tiles);
    // Cut each row of views into rows of tiles, so that no tile is part of two views
    let bands = plane.chunks_mut(width * view[1]);
    let mut top = 0;
    for pixels in bands.flat_map(|views| views.chunks_mut(width * rows)) {
        let first = all.len();
        let height = pixels.len() / width;
        // Place the tiles of this row
        for start in (0..width).step_by(view[0]) {
            let end = width.min(start + view[0]);
            all.extend((start..end).step_by(columns).map(|left| {
                let place = Rectangle { left, top, width: columns.min(end - left), height };
                (place, Vec::with_capacity(height))
            }));
        }
        // Give each of them its piece of every line
        for row in pixels.chunks_mut(width) {
            let pieces = row.chunks_mut(view[0]).flat_map(|part| part.chunks_mut(columns));
            for ((_, tile), piece) in all[first..].iter_mut().zip(pieces) {
                tile.push(piece);
            }
        }
        top += height;
    }
    all
}

/// Upper bound of the memory of [`tiles`] of an image of up to two views on each axis, divided into equal parts of at
/// most these lengths, bytes.
pub(super) fn tiles_bytes(width: u32, height: u32, max_columns: usize, max_rows: usize) -> u64 {
    // The parts of two views are one more at most
    let parts = |length: u32, max: usize| match length {
        0 | 1 => 1,
        _ => u64::from(length).div_ceil(max as u64) + 1,
    };
    let columns = parts(width, max_columns);
    let tiles = columns * parts(height, max_rows);
    let rows = columns * u64::from(height);
    tiles * size_of::<TileRows<'_>>() as u64 + rows * size_of::<&[[f32; 4]]>() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_a_plane_once() {
        for ([width, height], [max_columns, max_rows], views) in [
            ([1_u32, 1_u32], [9, 9], [1, 1]),
            ([7, 5], [3, 2], [1, 1]),
            ([154, 64], [154, 64], [1, 1]),
            ([155, 65], [154, 64], [1, 1]),
            ([14, 5], [3, 2], [2, 1]),
            ([5, 14], [3, 4], [1, 2]),
        ] {
            let predicted = tiles_bytes(width, height, max_columns, max_rows);
            let (width, height) = (width as usize, height as usize);
            let view = [width / views[0], height / views[1]];
            let columns = equal_part(view[0], max_columns);
            let rows = equal_part(view[1], max_rows);
            let mut plane = vec![[0.0; 4]; width * height];
            let all = tiles(&mut plane, width, view, [columns, rows]);
            let places = size_of_val(&all[..]);
            let lines: usize = all.iter().map(|(_, rows)| size_of_val(&rows[..])).sum();
            assert!((places + lines) as u64 <= predicted, "{width}x{height}");
            for (place, rows) in all {
                assert_eq!(place.left / view[0], (place.left + place.width - 1) / view[0]);
                assert_eq!(place.top / view[1], (place.top + place.height - 1) / view[1]);
                assert_eq!(rows.len(), place.height);
                for (y, row) in rows.into_iter().enumerate() {
                    assert_eq!(row.len(), place.width);
                    for (x, pixel) in row.iter_mut().enumerate() {
                        pixel[0] += (place.left + x) as f32;
                        pixel[1] += (place.top + y) as f32;
                        pixel[2] += 1.0;
                    }
                }
            }
            for (i, pixel) in plane.iter().enumerate() {
                let expected = [(i % width) as f32, (i / width) as f32, 1.0, 0.0];
                assert_eq!(*pixel, expected, "{width}x{height}");
            }
        }
    }

    #[test]
    fn rows_of_the_widest_tile_hold_all_that_is_compared() {
        for search in 1..=16 {
            let layout = TileLayout::new(search, TileLayout::max_width(search));
            // The first and the last columns have no noise
            let first = layout.column(-((search + PATCH_RADIUS) as isize));
            assert_eq!(first, NOISE_RADIUS);
            let end = layout.column(-(PATCH_RADIUS as isize)) + layout.compared;
            assert!(end <= STRIDE - NOISE_RADIUS, "{search}: {end}");
            assert!(layout.margin + layout.pairs <= STRIDE, "{search}");
            assert!(layout.pairs + 2 * PATCH_RADIUS <= STRIDE, "{search}");
        }
    }
}
