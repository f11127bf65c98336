//! Read access to consecutive rows of a finished film, in the form that encoders use.

use super::channels::Channels;
use super::film::{Film, PerPlane};
use super::planes::FilmPlane;

/// Rows `top..top + height` of every plane of the channels of a film.
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
    /// The bits of the components of each pixel; empty without the plane.
    planes: PerPlane<&'a [u32]>,
    /// Number of components of a pixel in each plane.
    sizes: PerPlane<usize>,
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
        let part = |plane: usize| {
            let size = self.sizes[plane];
            &self.planes[plane][range.start * size..range.end * size]
        };
        FilmRows {
            top,
            height,
            width: self.width,
            color: &self.color[range.clone()],
            planes: std::array::from_fn(part),
            sizes: self.sizes,
        }
    }

    /// The bits of the components of each pixel in `plane`, and their number in a pixel; empty without the plane.
    pub fn plane(&self, plane: FilmPlane) -> (&'a [u32], usize) {
        (self.planes[plane as usize], self.sizes[plane as usize])
    }
}

impl Film {
    /// All rows.
    pub fn rows(&self) -> FilmRows<'_> {
        let sizes = self.channels.sizes();
        FilmRows {
            top: 0,
            height: self.height,
            width: self.width,
            color: &self.color,
            // Features for denoising may have planes without being channels
            planes: std::array::from_fn(|plane| match sizes[plane] {
                0 => &[],
                _ => &self.planes[plane][..],
            }),
            sizes,
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
        for (at, id) in (0..).zip(film.plane_mut(FilmPlane::Id).unwrap()) {
            *id = at;
        }
        let part = film.rows().part(4, 5).part(6, 16);
        assert_eq!((part.top, part.height, part.width), (6, 3, 3));
        assert_eq!(part.plane(FilmPlane::Id), (&film.plane(FilmPlane::Id).unwrap()[18..27], 1));
        assert_eq!(part.color.len(), 9);
        assert_eq!(film.channels(), Channels::ALL);
        let film = Film::new(1, 1, Channels::COLOR);
        assert_eq!(film.channels(), Channels::COLOR);
        assert!(film.rows().part(0, 1).plane(FilmPlane::Depth).0.is_empty());
    }
}
