//! The finished image: one array per group of channels, row by row from the top.

use glam::Vec3;
use thiserror::Error;

use super::{
    aov::{DataSample, NO_ID},
    tile::RenderedTile,
};

/// Which planes a film has beside `R G B A`, which are always there.
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
}

/// No channel has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("no channel is called {name:?}, the known ones are RGBA, Z, N, P, V, albedo and id")]
pub struct UnknownChannel {
    /// What was asked for.
    pub name: String,
}

impl Channels {
    /// Colour and nothing else.
    pub const COLOR: Self = Self {
        depth: false,
        normal: false,
        position: false,
        velocity: false,
        albedo: false,
        id: false,
    };

    /// Everything there is.
    pub const ALL: Self = Self {
        depth: true,
        normal: true,
        position: true,
        velocity: true,
        albedo: true,
        id: true,
    };

    /// Channels by the names of a manifest; `RGBA` may be named and is always there.
    ///
    /// # Errors
    /// If there is no such channel.
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
                _ => {
                    return Err(UnknownChannel {
                        name: name.to_owned(),
                    });
                }
            }
        }
        Ok(channels)
    }
}

/// An image. Every plane holds `width * height` values, or is `None` if it was not asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Linear RGB, premultiplied by A. A is the part of the pixel that particles or ground cover;
    /// the background is in RGB where nothing covers, unless it was left out.
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
}

impl Film {
    /// An empty image: black, transparent, nothing met.
    pub fn new(width: u32, height: u32, channels: Channels) -> Self {
        let count = width as usize * height as usize;
        let vectors = |wanted: bool| wanted.then(|| vec![Vec3::ZERO; count]);
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
        }
    }

    /// Bytes of all planes of an image.
    pub fn bytes_for(width: u32, height: u32, channels: Channels) -> u64 {
        let scalars = [channels.depth, channels.id];
        let vectors = [
            channels.normal,
            channels.position,
            channels.velocity,
            channels.albedo,
        ];
        let count = |wanted: &[bool]| wanted.iter().filter(|w| **w).count() as u64;
        let pixel = 16 + 4 * count(&scalars) + 12 * count(&vectors);
        u64::from(width) * u64::from(height) * pixel
    }

    /// Cuts all planes into bands of `rows` rows (the last may have fewer), from the top.
    pub(super) fn bands_mut(&mut self, rows: u32) -> Vec<Band<'_>> {
        let length = self.width as usize * rows as usize;
        let mut depth = chunks(&mut self.depth, length);
        let mut normal = chunks(&mut self.normal, length);
        let mut position = chunks(&mut self.position, length);
        let mut velocity = chunks(&mut self.velocity, length);
        let mut albedo = chunks(&mut self.albedo, length);
        let mut id = chunks(&mut self.id, length);
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
            })
            .collect()
    }
}

type Chunks<'a, T> = Option<std::slice::ChunksMut<'a, T>>;

fn chunks<T>(plane: &mut Option<Vec<T>>, length: usize) -> Chunks<'_, T> {
    plane.as_mut().map(|values| values.chunks_mut(length))
}

fn next<'a, T>(chunks: &mut Chunks<'a, T>) -> Option<&'a mut [T]> {
    chunks.as_mut().and_then(Iterator::next)
}

/// Some whole rows of every plane.
pub(super) struct Band<'a> {
    /// First row of the image in this band.
    pub(super) top: u32,
    /// Rows in this band.
    pub(super) rows: u32,
    width: u32,
    color: &'a mut [[f32; 4]],
    depth: Option<&'a mut [f32]>,
    normal: Option<&'a mut [Vec3]>,
    position: Option<&'a mut [Vec3]>,
    velocity: Option<&'a mut [Vec3]>,
    albedo: Option<&'a mut [Vec3]>,
    id: Option<&'a mut [u32]>,
}

impl Band<'_> {
    /// Puts a finished tile of this band in its place.
    pub(super) fn store(&mut self, tile: &RenderedTile) {
        let width = tile.width as usize;
        for (row, pixels) in tile.pixels.chunks(width).enumerate() {
            let start = row * self.width as usize + tile.left as usize;
            let data = || pixels.iter().map(|(_, data)| data);
            let colors = pixels.iter().map(|(color, _)| *color);
            for (slot, color) in self.color[start..].iter_mut().zip(colors) {
                *slot = color;
            }
            fill(&mut self.depth, start, data(), |d| d.z);
            fill(&mut self.normal, start, data(), |d| d.normal);
            fill(&mut self.position, start, data(), |d| d.position);
            fill(&mut self.velocity, start, data(), |d| d.velocity);
            fill(&mut self.albedo, start, data(), |d| d.albedo);
            fill(&mut self.id, start, data(), |d| d.id);
        }
    }
}

fn fill<'d, T>(
    plane: &mut Option<&mut [T]>,
    start: usize,
    data: impl Iterator<Item = &'d DataSample>,
    value: impl Fn(&DataSample) -> T,
) {
    if let Some(plane) = plane {
        for (slot, sample) in plane[start..].iter_mut().zip(data) {
            *slot = value(sample);
        }
    }
}

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
        assert_eq!(Film::bytes_for(3, 2, channels), 6 * 24);
        let error = Channels::from_names(["depth"]).unwrap_err();
        assert!(error.to_string().contains("\"depth\""));
    }

    #[test]
    fn bands_cover_the_image_once() {
        let mut film = Film::new(5, 35, Channels::ALL);
        let bands = film.bands_mut(16);
        let rows: Vec<_> = bands.iter().map(|b| (b.top, b.rows)).collect();
        assert_eq!(rows, [(0, 16), (16, 16), (32, 3)]);
        assert_eq!(bands[2].color.len(), 15);
        assert_eq!(bands[2].id.as_ref().unwrap().len(), 15);
    }
}
