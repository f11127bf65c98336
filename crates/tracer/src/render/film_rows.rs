//! Read access to consecutive rows of a finished film, in the form that encoders use.

use glam::Vec3;

use super::film::{Channels, Film};

/// Rows `top..top + height` of every plane; planes that the film does not have are `None`.
#[derive(Debug, Clone, Copy)]
pub struct FilmRows<'a> {
    /// First row in the image.
    pub top: u32,
    /// Number of rows.
    pub height: u32,
    /// Width in pixels.
    pub width: u32,
    /// See [`Film::color`].
    pub color: &'a [[f32; 4]],
    /// See [`Film::depth`].
    pub depth: Option<&'a [f32]>,
    /// See [`Film::normal`].
    pub normal: Option<&'a [Vec3]>,
    /// See [`Film::position`].
    pub position: Option<&'a [Vec3]>,
    /// See [`Film::velocity`].
    pub velocity: Option<&'a [Vec3]>,
    /// See [`Film::albedo`].
    pub albedo: Option<&'a [Vec3]>,
    /// See [`Film::id`].
    pub id: Option<&'a [u32]>,
    /// See [`Film::layers`].
    pub layers: Option<&'a [f32]>,
    /// Number of floats of a pixel in `layers`.
    pub floats: usize,
}

impl<'a> FilmRows<'a> {
    /// `height` of these rows, or as many as there are, starting at row `top` of the image.
    ///
    /// # Panics
    /// If row `top` is not among these rows.
    pub fn part(&self, top: u32, height: u32) -> FilmRows<'a> {
        // Find the pixels of these rows in all planes
        let skipped = top
            .checked_sub(self.top)
            .filter(|rows| *rows < self.height)
            .expect("the part begins in these rows");
        let height = height.min(self.height - skipped);
        let width = self.width as usize;
        let range = skipped as usize * width..(skipped + height) as usize * width;
        FilmRows {
            top,
            height,
            width: self.width,
            color: &self.color[range.clone()],
            depth: self.depth.map(|plane| &plane[range.clone()]),
            normal: self.normal.map(|plane| &plane[range.clone()]),
            position: self.position.map(|plane| &plane[range.clone()]),
            velocity: self.velocity.map(|plane| &plane[range.clone()]),
            albedo: self.albedo.map(|plane| &plane[range.clone()]),
            id: self.id.map(|plane| &plane[range.clone()]),
            layers: self
                .layers
                .map(|plane| &plane[range.start * self.floats..range.end * self.floats]),
            floats: self.floats,
        }
    }
}

impl Film {
    /// All rows.
    pub fn rows(&self) -> FilmRows<'_> {
        let channels = self.channels;
        FilmRows {
            top: 0,
            height: self.height,
            width: self.width,
            color: &self.color,
            depth: self.depth.as_deref().filter(|_| channels.depth),
            normal: self.normal.as_deref().filter(|_| channels.normal),
            position: self.position.as_deref(),
            velocity: self.velocity.as_deref(),
            albedo: self.albedo.as_deref().filter(|_| channels.albedo),
            id: self.id.as_deref(),
            layers: self.layers.as_deref(),
            floats: channels.layers.floats(),
        }
    }

    /// The channels in addition to colour.
    pub const fn channels(&self) -> Channels {
        self.channels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_keep_their_position() {
        let mut film = Film::new(3, 10, Channels::ALL);
        for (at, id) in (0..).zip(film.id.iter_mut().flatten()) {
            *id = at;
        }
        let part = film.rows().part(4, 5).part(6, 16);
        assert_eq!((part.top, part.height, part.width), (6, 3, 3));
        assert_eq!(part.id.unwrap(), &film.id.as_ref().unwrap()[18..27]);
        assert_eq!(part.color.len(), 9);
        assert_eq!(film.channels(), Channels::ALL);
        let film = Film::new(1, 1, Channels::COLOR);
        assert_eq!(film.channels(), Channels::COLOR);
        assert!(film.rows().part(0, 1).depth.is_none());
    }
}
