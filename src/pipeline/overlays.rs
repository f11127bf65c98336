//! The overlays of images.

use super::renderer::TracedFrame;
use super::setup::Setup;
use crate::overlay::{Area, Drawing, FrameValues, FrameView, Page, Sprite, areas, draw, marks};
use crate::render::{Film, FilmPlane};
use crate::scene::{Camera, Projection, RgbEncoding};

impl Setup {
    /// Lengths of the scene in the height of the picture, in perspective at the distance of the centre of the
    /// particles.
    pub fn units_per_height(&self, camera: &Camera) -> f64 {
        if let Projection::Orthographic { height } = camera.projection() {
            return height;
        }
        let [min, max] = self.picture.scene.particles;
        let depth = f64::from(camera.depth_of(0.5 * (min + max)));
        2.0 * f64::from(camera.half_extent().y) * depth
    }

    /// What overlays show of an image.
    fn frame_view(&self, frame: &TracedFrame) -> FrameView {
        let names = self.picture.files.overlay_values.iter().cloned();
        let [right, up, forward] = frame.camera.axes();
        let axis = |i: usize| [right[i], up[i], forward[i]];
        FrameView {
            values: FrameValues {
                time: frame.time,
                frame: frame.task.frame,
                particles: frame.report.particles,
                file: frame.facts.file.clone(),
                ranges: names.zip(frame.facts.ranges.iter().copied()).collect(),
            },
            units_per_height: self.units_per_height(&frame.camera),
            axes: [axis(0), axis(1), axis(2)],
        }
    }

    /// Where the film is on its page.
    pub(super) fn film_at(&self) -> [u32; 2] {
        self.picture.files.preview.page.map_or([0, 0], |own| own.page.at)
    }

    /// The page of a film of this size.
    fn page_of(&self, width: u32, height: u32) -> Page {
        let own = self.picture.files.preview.page;
        own.map_or_else(|| Page::whole(width, height), |own| own.page)
    }

    /// The drawing commands of the overlays of an image with one eye.
    pub(super) fn drawings_of(&self, frame: &TracedFrame) -> Vec<Drawing> {
        let (width, height) = (frame.film.width, frame.film.height);
        let page = self.page_of(width, height);
        marks(&self.picture.files.overlays, &page, &self.frame_view(frame))
    }

    /// The page of an image, and the areas of its overlays. Those of two eyes have none.
    pub fn overlay_areas(&self, frame: &TracedFrame) -> (Page, Vec<Area>) {
        let page = self.page_of(frame.film.width, frame.film.height);
        if frame.camera.eyes() != [1, 1] {
            return (page, Vec::new());
        }
        (page, areas(&self.picture.files.overlays, &page, &self.frame_view(frame)))
    }

    /// The overlays of an image.
    pub(super) fn overlays_of(&self, frame: &TracedFrame) -> Vec<Sprite> {
        let overlays = &self.picture.files.overlays;
        if overlays.is_empty() {
            return Vec::new();
        }
        // Each eye has its own, with which they appear at the distance of the screen
        let [columns, rows] = frame.camera.eyes();
        let (width, height) = (frame.film.width / columns, frame.film.height / rows);
        let page = self.page_of(width, height);
        let mut sprites = draw(overlays, &page, &self.frame_view(frame));
        if [columns, rows] != [1, 1] {
            let shift = [width * (columns - 1), height * (rows - 1)].map(u32::cast_signed);
            let right = sprites.clone().into_iter().map(|sprite| Sprite {
                left: sprite.left + shift[0],
                top: sprite.top + shift[1],
                ..sprite
            });
            sprites.extend(right.collect::<Vec<_>>());
        }
        sprites
    }
}

/// Stores overlays in their plane of `film`, if it has one. The film is at this place of the page of the sprites.
pub(super) fn store(film: &mut Film, sprites: &[Sprite], [left, top]: [u32; 2]) {
    let width = film.width as usize;
    let Some(pixels) = film.plane_mut::<[f32; 4]>(FilmPlane::Overlay) else {
        return;
    };
    // Move sprites from the page to the film
    let moved = sprites.iter().map(|sprite| Sprite {
        left: sprite.left - left.cast_signed(),
        top: sprite.top - top.cast_signed(),
        ..sprite.clone()
    });
    let sprites: Vec<Sprite> = moved.collect();
    // Blend them row by row over an empty layer
    for (row, y) in pixels.chunks_mut(width.max(1)).zip(0..) {
        // The plane may be that of another image
        row.fill([0.0; 4]);
        for sprite in &sprites {
            sprite.each_in_row(y, width, |x, pixel| blend(&mut row[x], pixel));
        }
    }
}

/// Draws premultiplied sRGB over linear RGB with alpha.
fn blend(under: &mut [f32; 4], [r, g, b, a]: [u8; 4]) {
    if a == 0 {
        return;
    }
    let alpha = f32::from(a) / 255.0;
    let straight = [r, g, b].map(|byte| f64::from(byte) / f64::from(a) * 255.0);
    let color = alpha * RgbEncoding::Srgb8.color(straight);
    for (under, over) in under.iter_mut().zip([color.x, color.y, color.z, alpha]) {
        *under = over + *under * (1.0 - alpha);
    }
}
