//! The finished image: one array per group of channels, row by row from the top.

use bytemuck::zeroed_vec;
use glam::Vec3;
use thiserror::Error;

use super::aov::{DataSample, NO_ID};
use super::layers::{Layers, MatteKind};

/// The planes of a film in addition to `R G B A`, which it always has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Channels {
    /// `Z`: distance along the view axis.
    pub depth: bool,
    /// `N`: normal in world space.
    pub normal: bool,
    /// `P`: position in world units.
    pub position: bool,
    /// `V`: the velocity attribute.
    pub velocity: bool,
    /// `albedo`: base colour.
    pub albedo: bool,
    /// `id`: the particle's id.
    pub id: bool,
    /// Planes for compositing.
    pub layers: Layers,
}

/// An unknown channel name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "no channel is called {name:?}, the known ones are RGBA, Z, N, P, V, albedo, id, lights, diffuse, specular, \
     reflection, refraction, emission, background, light_groups, noisy, shadow, motion, cryptomatte, crypto_particle, \
     crypto_material and crypto_part"
)]
pub struct UnknownChannel {
    /// The name.
    pub name: String,
}

impl Channels {
    /// Colour only.
    pub const COLOR: Self = Self {
        depth: false,
        normal: false,
        position: false,
        velocity: false,
        albedo: false,
        id: false,
        layers: Layers::NONE,
    };

    /// Colour and all data channels, without [`Layers`].
    pub const ALL: Self = Self {
        depth: true,
        normal: true,
        position: true,
        velocity: true,
        albedo: true,
        id: true,
        layers: Layers::NONE,
    };

    /// Whether a channel depends on the ids of particles.
    pub const fn needs_ids(&self) -> bool {
        self.id || self.layers.mattes.contains(MatteKind::Particle)
    }

    /// Whether a channel depends on the velocities of particles.
    pub const fn needs_velocities(&self) -> bool {
        self.velocity || self.layers.motion
    }

    /// Whether a channel depends on the parts of particles.
    pub const fn needs_parts(&self) -> bool {
        self.layers.mattes.contains(MatteKind::Part)
    }

    /// Whether a channel is that of the nearest sample of a pixel.
    pub const fn needs_nearest(&self) -> bool {
        self.depth || self.normal || self.position || self.albedo || self.needs_nearest_particle()
    }

    /// Whether the nearest sample of a pixel needs the index of its particle.
    pub const fn needs_nearest_particle(&self) -> bool {
        self.id || self.needs_velocities() || self.layers.attributes > 0
    }

    /// Whether a channel depends on the attributes of single particles, so that their indices are needed.
    pub const fn needs_particles(&self) -> bool {
        self.needs_nearest_particle() || self.needs_ids() || self.needs_parts()
    }

    /// These and, if `has_features`, those that are features for denoising.
    #[must_use]
    pub(super) const fn with_features(self, has_features: bool) -> Self {
        Self {
            depth: self.depth || has_features,
            normal: self.normal || has_features,
            albedo: self.albedo || has_features,
            ..self
        }
    }

    /// Channels by their names in a manifest; `RGBA` is allowed, and always included. Attributes have no fixed names.
    ///
    /// # Errors
    /// If a name is unknown.
    pub fn from_names<'a>(
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, UnknownChannel> {
        let mut channels = Self::COLOR;
        for name in names {
            match name {
                "RGBA" => {}
                "Z" => channels.depth = true,
                "N" => channels.normal = true,
                "P" => channels.position = true,
                "V" => channels.velocity = true,
                "albedo" => channels.albedo = true,
                "id" => channels.id = true,
                _ => channels
                    .layers
                    .insert(name)
                    .ok_or_else(|| UnknownChannel { name: name.to_owned() })?,
            }
        }
        Ok(channels)
    }
}

/// An image. Every plane has `width * height` values; planes that were not requested are `None`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear RGB, premultiplied by A. A is the fraction of the pixel that particles or ground cover; RGB includes
    /// the background of uncovered fractions, unless the background is transparent.
    pub color: Vec<[f32; 4]>,
    /// See [`DataSample::z`].
    pub depth: Option<Vec<f32>>,
    /// See [`DataSample::normal`].
    pub normal: Option<Vec<Vec3>>,
    /// See [`DataSample::position`].
    pub position: Option<Vec<Vec3>>,
    /// See [`DataSample::velocity`].
    pub velocity: Option<Vec<Vec3>>,
    /// See [`DataSample::albedo`].
    pub albedo: Option<Vec<Vec3>>,
    /// See [`DataSample::id`].
    pub id: Option<Vec<u32>>,
    /// The floats of [`Channels::layers`], pixel by pixel.
    pub layers: Option<Vec<f32>>,
    /// Mean of the samples 1, 3, 5 and so on of a film for [denoising](crate::denoise), linear RGB. Not a channel.
    pub odd: Option<Vec<Vec3>>,
    /// The channels; the film may have other planes as features for denoising.
    pub channels: Channels,
}

impl Film {
    /// An empty image: black and transparent, without intersections.
    pub fn new(width: u32, height: u32, channels: Channels) -> Self {
        let count = width as usize * height as usize;
        let vectors = |is_present: bool| is_present.then(|| vec![Vec3::ZERO; count]);
        Self {
            width,
            height,
            color: vec![[0.0; 4]; count],
            depth: channels.depth.then(|| vec![f32::INFINITY; count]),
            normal: vectors(channels.normal),
            position: vectors(channels.position),
            velocity: vectors(channels.velocity),
            albedo: vectors(channels.albedo),
            id: channels.id.then(|| vec![NO_ID; count]),
            layers: layers(channels).map(|floats| vec![0.0; count * floats]),
            odd: None,
            channels,
        }
    }

    /// A film of zeros. Its pages are allocated when they are first written.
    fn zeroed(width: u32, height: u32, channels: Channels, has_features: bool) -> Self {
        let count = width as usize * height as usize;
        let planes = channels.with_features(has_features);
        let vectors = |is_stored: bool| is_stored.then(|| zeroed_vec::<Vec3>(count));
        Self {
            width,
            height,
            color: zeroed_vec(count),
            depth: planes.depth.then(|| zeroed_vec(count)),
            normal: vectors(planes.normal),
            position: vectors(planes.position),
            velocity: vectors(planes.velocity),
            albedo: vectors(planes.albedo),
            id: planes.id.then(|| zeroed_vec(count)),
            layers: layers(channels).map(|floats| zeroed_vec(count * floats)),
            odd: vectors(has_features),
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
        let channels = channels.with_features(has_features);
        let scalars = [channels.depth, channels.id];
        let vectors =
            [channels.normal, channels.position, channels.velocity, channels.albedo, has_features];
        let count = |is_present: &[bool]| is_present.iter().filter(|w| **w).count() as u64;
        let layers = 4 * channels.layers.floats() as u64;
        let pixel = 16 + 4 * count(&scalars) + 12 * count(&vectors) + layers;
        u64::from(width) * u64::from(height) * pixel
    }

    /// Splits all planes into bands of `rows` rows, from the top; the last band may have fewer.
    pub(super) fn bands_mut(&mut self, rows: u32) -> Vec<Band<'_>> {
        // Divide each plane; unused planes are empty
        let length = self.width as usize * rows as usize;
        let mut depth = chunks(&mut self.depth, length);
        let mut normal = chunks(&mut self.normal, length);
        let mut position = chunks(&mut self.position, length);
        let mut velocity = chunks(&mut self.velocity, length);
        let mut albedo = chunks(&mut self.albedo, length);
        let mut id = chunks(&mut self.id, length);
        let floats = self.channels.layers.floats();
        let mut layers = chunks(&mut self.layers, length * floats);
        let mut odd = chunks(&mut self.odd, length);
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
                depth: next(&mut depth),
                normal: next(&mut normal),
                position: next(&mut position),
                velocity: next(&mut velocity),
                albedo: next(&mut albedo),
                id: next(&mut id),
                layers: next(&mut layers),
                floats,
                odd: next(&mut odd),
            })
            .collect()
    }
}

/// Number of floats of a pixel, if there are layers.
fn layers(channels: Channels) -> Option<usize> {
    Some(channels.layers.floats()).filter(|floats| *floats > 0)
}

type Chunks<'a, T> = Option<std::slice::ChunksMut<'a, T>>;

fn chunks<T>(plane: &mut Option<Vec<T>>, length: usize) -> Chunks<'_, T> {
    plane.as_mut().map(|values| values.chunks_mut(length))
}

fn next<T>(pieces: &mut Option<impl Iterator<Item = T>>) -> Option<T> {
    pieces.as_mut().and_then(Iterator::next)
}

/// Consecutive rows of every plane.
pub(super) struct Band<'a> {
    /// First row in the image.
    top: u32,
    rows: u32,
    width: u32,
    color: &'a mut [[f32; 4]],
    depth: Option<&'a mut [f32]>,
    normal: Option<&'a mut [Vec3]>,
    position: Option<&'a mut [Vec3]>,
    velocity: Option<&'a mut [Vec3]>,
    albedo: Option<&'a mut [Vec3]>,
    id: Option<&'a mut [u32]>,
    layers: Option<&'a mut [f32]>,
    /// Number of floats of a pixel in `layers`.
    floats: usize,
    odd: Option<&'a mut [Vec3]>,
}

impl Band<'_> {
    /// Splits the band into tiles of `side` columns, from the left; the last tile may have fewer.
    pub(super) fn tiles(&mut self, side: u32) -> Vec<FilmTile<'_>> {
        // Divide the rows of each plane
        let (width, columns) = (self.width as usize, side as usize);
        let mut color = rows_of_tiles(self.color, width, columns).into_iter();
        let mut depth = planes(&mut self.depth, width, columns);
        let mut normal = planes(&mut self.normal, width, columns);
        let mut position = planes(&mut self.position, width, columns);
        let mut velocity = planes(&mut self.velocity, width, columns);
        let mut albedo = planes(&mut self.albedo, width, columns);
        let mut id = planes(&mut self.id, width, columns);
        let floats = self.floats;
        let mut layers = planes(&mut self.layers, width * floats, columns * floats);
        let mut odd = planes(&mut self.odd, width, columns);
        // Combine the rows of all planes into tiles
        let tile = |left: u32| FilmTile {
            left,
            top: self.top,
            width: side.min(self.width - left),
            rows: self.rows,
            color: color.next().unwrap_or_default(),
            depth: next(&mut depth),
            normal: next(&mut normal),
            position: next(&mut position),
            velocity: next(&mut velocity),
            albedo: next(&mut albedo),
            id: next(&mut id),
            layers: next(&mut layers),
            floats,
            odd: next(&mut odd),
        };
        (0..self.width).step_by(columns).map(tile).collect()
    }
}

/// The rows of one plane in a tile.
type Rows<'a, T> = Vec<&'a mut [T]>;

/// The rows of each tile of `columns` columns, from a band of a plane.
fn rows_of_tiles<T>(band: &mut [T], width: usize, columns: usize) -> Vec<Rows<'_, T>> {
    let mut tiles = Vec::new();
    tiles.resize_with(width.div_ceil(columns), Rows::new);
    for row in band.chunks_mut(width) {
        for (tile, piece) in tiles.iter_mut().zip(row.chunks_mut(columns)) {
            tile.push(piece);
        }
    }
    tiles
}

type Pieces<'a, T> = Option<std::vec::IntoIter<Rows<'a, T>>>;

fn planes<'a, T>(plane: &'a mut Option<&mut [T]>, width: usize, columns: usize) -> Pieces<'a, T> {
    let plane = plane.as_mut();
    plane.map(|plane| rows_of_tiles(plane, width, columns).into_iter())
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
    color: Rows<'a, [f32; 4]>,
    depth: Option<Rows<'a, f32>>,
    normal: Option<Rows<'a, Vec3>>,
    position: Option<Rows<'a, Vec3>>,
    velocity: Option<Rows<'a, Vec3>>,
    albedo: Option<Rows<'a, Vec3>>,
    id: Option<Rows<'a, u32>>,
    layers: Option<Rows<'a, f32>>,
    /// Number of floats of a pixel in `layers`.
    floats: usize,
    odd: Option<Rows<'a, Vec3>>,
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

    /// Stores the mean of the odd samples of the pixel in `column` and `row` of the tile, linear RGB.
    pub(super) fn set_odd(&mut self, column: u32, row: u32, mean: Vec3) {
        set_pixel(&mut self.odd, (column as usize, row as usize), mean);
    }

    /// The floats of the layers of the pixel in `column` and `row` of the tile; none without layers.
    pub(super) fn layers_mut(&mut self, column: u32, row: u32) -> &mut [f32] {
        let Some(rows) = &mut self.layers else {
            return &mut [];
        };
        let start = column as usize * self.floats;
        &mut rows[row as usize][start..start + self.floats]
    }

    /// Stores the data of the pixel in `column` and `row` of the tile in all planes that exist.
    pub(super) fn set_data(&mut self, column: u32, row: u32, data: &DataSample) {
        let at = (column as usize, row as usize);
        set_pixel(&mut self.depth, at, data.z);
        set_pixel(&mut self.normal, at, data.normal);
        set_pixel(&mut self.position, at, data.position);
        set_pixel(&mut self.velocity, at, data.velocity);
        set_pixel(&mut self.albedo, at, data.albedo);
        set_pixel(&mut self.id, at, data.id);
    }
}

fn set_pixel<T>(plane: &mut Option<Rows<'_, T>>, (column, row): (usize, usize), value: T) {
    if let Some(rows) = plane {
        rows[row][column] = value;
    }
}

#[cfg(test)]
#[path = "film_tests.rs"]
mod every_pixel;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_choose_planes() {
        let channels = Channels::from_names(["RGBA", "Z", "id"]).unwrap();
        assert!(channels.depth && channels.id && !channels.normal);
        let film = Film::new(3, 2, channels);
        assert_eq!(film.depth.as_ref().unwrap().len(), 6);
        assert_eq!(film.id.as_ref().unwrap()[5], NO_ID);
        assert!(film.normal.is_none());
        assert_eq!(Film::bytes_for(3, 2, channels, false), 6 * 24);
        assert_eq!(Film::bytes_for(3, 2, channels, true), 6 * (24 + 3 * 12));
        let channels = Channels::from_names(["lights", "shadow", "crypto_part"]).unwrap();
        assert_eq!(channels.layers.floats(), 18 + 1 + 12);
        assert_eq!(Film::new(3, 2, channels).layers.unwrap().len(), 6 * 31);
        assert_eq!(Film::bytes_for(3, 2, channels, false), 6 * (16 + 4 * 31));
        let error = Channels::from_names(["depth"]).unwrap_err();
        assert!(error.to_string().contains("\"depth\""));
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
            assert_eq!(film.id.as_ref().unwrap()[place] as f32, number);
        }
    }
}
