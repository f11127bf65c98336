//! The finished image: one array per group of channels, row by row from the top.

use bytemuck::{Pod, cast_slice, cast_slice_mut, zeroed_vec};

use super::aov::DataSample;
use super::channels::Channels;
use super::planes::FilmPlane;

/// A value for each plane, by its number.
pub(super) type PerPlane<T> = [T; FilmPlane::COUNT];

/// An image.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear RGB, premultiplied by A. A is the fraction of the pixel that particles or ground cover; RGB includes
    /// the background of uncovered fractions, unless the background is transparent.
    pub color: Vec<[f32; 4]>,
    /// The bits of the components of each pixel; empty without the plane.
    pub(super) planes: PerPlane<Vec<u32>>,
    /// Mean of the samples 1, 3, 5 and so on of a film for [denoising](crate::denoise), as in [`Self::color`]. Not a
    /// channel.
    pub odd: Option<Vec<[f32; 4]>>,
    /// The channels; the film may have other planes as features for denoising.
    pub channels: Channels,
}

impl Film {
    /// An empty image: black and transparent, without intersections.
    pub fn new(width: u32, height: u32, channels: Channels) -> Self {
        let mut film = Self::zeroed(width, height, channels, false);
        for (plane, words) in FilmPlane::all().zip(&mut film.planes) {
            words.fill(plane.miss());
        }
        film
    }

    /// A film of zeros. Its pages are allocated when they are first written.
    fn zeroed(width: u32, height: u32, channels: Channels, has_features: bool) -> Self {
        let count = width as usize * height as usize;
        Self {
            width,
            height,
            color: zeroed_vec(count),
            planes: channels
                .with_features(has_features)
                .sizes()
                .map(|size| zeroed_vec(count * size)),
            odd: has_features.then(|| zeroed_vec(count)),
            channels,
        }
    }

    /// Makes this a film of that size with these channels, and with the features for denoising if `has_features`. If it
    /// is one already, its memory and content stay; the renderer sets every pixel. New planes are not written here, so
    /// that the page faults of their first use are shared by all tracing threads.
    pub(super) fn fit(&mut self, width: u32, height: u32, channels: Channels, has_features: bool) {
        let is_fit = (self.width, self.height) == (width, height)
            && self.channels == channels
            && self.odd.is_some() == has_features;
        if !is_fit {
            // Release the old planes before the new ones are allocated.
            *self = Self::default();
            *self = Self::zeroed(width, height, channels, has_features);
        }
    }

    /// Memory of all planes of an image, bytes. `has_features`: it will be denoised.
    pub fn bytes_for(width: u32, height: u32, channels: Channels, has_features: bool) -> u64 {
        let sizes = channels.with_features(has_features).sizes();
        let odd = if has_features { 4 } else { 0 };
        let floats = 4 + sizes.iter().sum::<usize>() + odd;
        u64::from(width) * u64::from(height) * 4 * floats as u64
    }

    /// The values of a plane, pixel by pixel: numbers of four bytes or vectors of them. None without the plane.
    ///
    /// # Panics
    /// If a pixel has no whole number of `T`.
    pub fn plane<T: Pod>(&self, plane: FilmPlane) -> Option<&[T]> {
        let words = &self.planes[plane as usize];
        (!words.is_empty()).then(|| cast_slice(words))
    }

    /// Same as [`Self::plane`], to change them.
    ///
    /// # Panics
    /// If a pixel has no whole number of `T`.
    pub fn plane_mut<T: Pod>(&mut self, plane: FilmPlane) -> Option<&mut [T]> {
        let words = &mut self.planes[plane as usize];
        (!words.is_empty()).then(|| cast_slice_mut(words))
    }

    /// Splits all planes into bands of `rows` rows, from the top; the last band may have fewer.
    pub(super) fn bands_mut(&mut self, rows: u32) -> Vec<Band<'_>> {
        // Divide each plane; unused planes are empty
        let length = self.width as usize * rows as usize;
        let sizes = self.channels.with_features(self.odd.is_some()).sizes();
        let planes = self.planes.iter_mut().zip(sizes);
        let mut planes: Vec<_> =
            planes.map(|(words, size)| words.chunks_mut((length * size).max(1))).collect();
        let mut odd = self.odd.as_mut().map(|values| values.chunks_mut(length));
        // Combine the chunks of all planes into bands
        let top_rows = (0..self.height).step_by(rows as usize);
        let color = self.color.chunks_mut(length);
        color
            .zip(top_rows)
            .map(|(color, top)| Band {
                top,
                width: self.width,
                rows: rows.min(self.height - top),
                color,
                planes: std::array::from_fn(|plane| planes[plane].next().unwrap_or_default()),
                sizes,
                odd: odd.as_mut().and_then(Iterator::next),
            })
            .collect()
    }
}

/// Consecutive rows of every plane.
pub(super) struct Band<'a> {
    /// First row in the image.
    top: u32,
    rows: u32,
    width: u32,
    color: &'a mut [[f32; 4]],
    planes: PerPlane<&'a mut [u32]>,
    /// Number of components of a pixel in each plane.
    sizes: PerPlane<usize>,
    odd: Option<&'a mut [[f32; 4]]>,
}

impl Band<'_> {
    /// Splits the band into tiles of `side` columns, from the left; the last tile may have fewer.
    pub(super) fn tiles(&mut self, side: u32) -> Vec<FilmTile<'_>> {
        // Divide the rows of each plane
        let (width, columns) = (self.width as usize, side as usize);
        let mut color = rows_of_tiles(self.color, width, columns).into_iter();
        let planes = self.planes.iter_mut().zip(self.sizes);
        let mut planes: Vec<_> = planes
            .map(|(words, size)| rows_of_tiles(words, width * size, columns * size).into_iter())
            .collect();
        let odd = self.odd.as_mut().map(|odd| rows_of_tiles(odd, width, columns).into_iter());
        let mut odd = odd.into_iter().flatten();
        // Combine the rows of all planes into tiles
        let tile = |left: u32| FilmTile {
            left,
            top: self.top,
            width: side.min(self.width - left),
            rows: self.rows,
            color: color.next().unwrap_or_default(),
            planes: std::array::from_fn(|plane| planes[plane].next().unwrap_or_default()),
            sizes: self.sizes,
            odd: odd.next(),
        };
        (0..self.width).step_by(columns).map(tile).collect()
    }
}

/// The rows of one plane in a tile.
pub(super) type Rows<'a, T> = Vec<&'a mut [T]>;

/// The rows of each tile of `columns` values, from a band of a plane with `width` values in a row; none without values.
fn rows_of_tiles<T>(band: &mut [T], width: usize, columns: usize) -> Vec<Rows<'_, T>> {
    let mut tiles = Vec::new();
    if width == 0 {
        return tiles;
    }
    tiles.resize_with(width.div_ceil(columns), Rows::new);
    for row in band.chunks_mut(width) {
        for (tile, piece) in tiles.iter_mut().zip(row.chunks_mut(columns)) {
            tile.push(piece);
        }
    }
    tiles
}

/// A rectangle of every plane, which one thread fills.
pub(super) struct FilmTile<'a> {
    /// First column in the image.
    pub(super) left: u32,
    /// First row in the image.
    pub(super) top: u32,
    /// Width in pixels.
    pub(super) width: u32,
    /// Height in pixels.
    pub(super) rows: u32,
    pub(super) color: Rows<'a, [f32; 4]>,
    pub(super) planes: PerPlane<Rows<'a, u32>>,
    /// Number of components of a pixel in each plane.
    pub(super) sizes: PerPlane<usize>,
    pub(super) odd: Option<Rows<'a, [f32; 4]>>,
}

impl FilmTile<'_> {
    /// Stores the colour of the pixel in `column` and `row` of the tile.
    pub(super) fn set_color(&mut self, column: u32, row: u32, color: [f32; 4]) {
        self.color[row as usize][column as usize] = color;
    }

    /// Whether the film has the mean of odd samples.
    pub(super) const fn has_odd(&self) -> bool {
        self.odd.is_some()
    }

    /// Stores the mean of the odd samples of the pixel in `column` and `row` of the tile.
    pub(super) fn set_odd(&mut self, column: u32, row: u32, mean: [f32; 4]) {
        if let Some(rows) = &mut self.odd {
            rows[row as usize][column as usize] = mean;
        }
    }

    /// The components of a plane of the pixel in `column` and `row` of the tile; none without the plane.
    pub(super) fn components_mut(&mut self, plane: FilmPlane, column: u32, row: u32) -> &mut [f32] {
        let size = self.sizes[plane as usize];
        match self.planes[plane as usize].get_mut(row as usize) {
            Some(row) => cast_slice_mut(&mut row[column as usize * size..][..size]),
            None => &mut [],
        }
    }

    /// Stores the data of the pixel in `column` and `row` of the tile in all planes that exist.
    pub(super) fn set_data(&mut self, column: u32, row: u32, data: &DataSample) {
        let at = (column as usize, row as usize);
        self.set(FilmPlane::Depth, at, &data.z);
        self.set(FilmPlane::Normal, at, &data.normal);
        self.set(FilmPlane::Position, at, &data.position);
        self.set(FilmPlane::Velocity, at, &data.velocity);
        self.set(FilmPlane::Albedo, at, &data.albedo);
        self.set(FilmPlane::Id, at, &data.id);
        self.set(FilmPlane::Motion, at, &data.motion);
        self.set(FilmPlane::MotionBack, at, &data.motion_back);
    }

    /// Stores the components of a pixel, all in one value, if the plane exists.
    #[inline(always)]
    fn set<T: Pod>(&mut self, plane: FilmPlane, (column, row): (usize, usize), value: &T) {
        if let Some(row) = self.planes[plane as usize].get_mut(row) {
            let words: &[u32] = cast_slice(std::slice::from_ref(value));
            row[column * words.len()..][..words.len()].copy_from_slice(words);
        }
    }
}

/// The colour of a pixel, not negative and with a coverage of 0 to 1 if `is_bounded`.
pub(super) fn bounded([r, g, b, a]: [f32; 4], is_bounded: bool) -> [f32; 4] {
    if is_bounded { [r.max(0.0), g.max(0.0), b.max(0.0), a.clamp(0.0, 1.0)] } else { [r, g, b, a] }
}

#[cfg(test)]
#[path = "film_tests.rs"]
mod every_pixel;

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::render::aov::NO_ID;

    #[test]
    fn channels_choose_planes() {
        let channels = Channels::from_names(["RGBA", "Z", "id"]).unwrap();
        let film = Film::new(3, 2, channels);
        assert_eq!(film.plane::<f32>(FilmPlane::Depth).unwrap(), [f32::INFINITY; 6]);
        assert_eq!(film.plane::<u32>(FilmPlane::Id).unwrap()[5], NO_ID);
        assert!(film.plane::<Vec3>(FilmPlane::Normal).is_none());
        assert_eq!(Film::bytes_for(3, 2, channels, false), 6 * 24);
        assert_eq!(Film::bytes_for(3, 2, channels, true), 6 * (24 + 2 * 12 + 16));
        let channels = Channels::from_names(["lights", "shadow", "crypto_part"]).unwrap();
        let film = Film::new(3, 2, channels);
        assert_eq!(film.plane::<f32>(FilmPlane::CryptoPart).unwrap().len(), 6 * 12);
        assert_eq!(Film::bytes_for(3, 2, channels, false), 6 * (16 + 4 * 31));
    }

    #[test]
    fn tiles_cover_the_image_once() {
        let mut film = Film::new(21, 35, Channels::ALL);
        let mut bands = film.bands_mut(16);
        let mut tiles: Vec<_> = bands.iter_mut().flat_map(|band| band.tiles(16)).collect();
        let sizes: Vec<_> = tiles.iter().map(|t| (t.left, t.top, t.width, t.rows)).collect();
        let is_present = [
            (0, 0, 16, 16),
            (16, 0, 5, 16),
            (0, 16, 16, 16),
            (16, 16, 5, 16),
            (0, 32, 16, 3),
            (16, 32, 5, 3),
        ];
        assert_eq!(sizes, is_present);
        for (number, tile) in (1_u8..).zip(&mut tiles) {
            let (width, rows) = (tile.width, tile.rows);
            for pixel in 0..width * rows {
                let (column, row) = (pixel % width, pixel / width);
                let id = u32::from(number);
                tile.set_color(column, row, [f32::from(number); 4]);
                tile.set_data(column, row, &DataSample { id, ..DataSample::MISS });
            }
        }
        let of_tile = |x: usize, y: usize| 1.0 + (y / 16 * 2 + x / 16) as f32;
        for (place, color) in film.color.iter().enumerate() {
            let number = of_tile(place % 21, place / 21);
            assert_eq!(color[0], number);
            assert_eq!(film.plane::<u32>(FilmPlane::Id).unwrap()[place] as f32, number);
        }
    }
}
