//! How a picture is divided into tiles.

use glam::Vec3;

use super::planes::STRIDE;
use super::settings::PATCH_RADIUS;
use crate::math::LANES;

/// Neighbours on each side over which variances are averaged.
pub(super) const NOISE_RADIUS: usize = 1;

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

/// Splits a plane into tiles of up to `columns` x `rows` pixels: the place of each, and its rows.
pub(super) fn tiles(
    plane: &mut [Vec3],
    width: usize,
    columns: usize,
    rows: usize,
) -> Vec<(Rectangle, Vec<&mut [Vec3]>)> {
    let mut all = Vec::new();
    for (band, pixels) in plane.chunks_mut(width * rows).enumerate() {
        let first = all.len();
        let height = pixels.len() / width;
        let place = |left: usize| Rectangle {
            left,
            top: band * rows,
            width: columns.min(width - left),
            height,
        };
        let lefts = (0..width).step_by(columns);
        all.extend(lefts.map(|left| (place(left), Vec::with_capacity(height))));
        for row in pixels.chunks_mut(width) {
            for ((_, tile), piece) in all[first..].iter_mut().zip(row.chunks_mut(columns)) {
                tile.push(piece);
            }
        }
    }
    all
}
