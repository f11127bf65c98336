//! A square of pixels rendered by one thread.

use glam::{Vec2, Vec3};

use super::{
    RayCounts, RenderSettings, ShadeSource,
    aov::DataSample,
    film::Band,
    sampler::PixelSampler,
    whitted::{Scratch, Tracer},
};
use crate::surface::Surface;

/// Pixels along a tile's side: enough work to hide the scheduling, small enough to share evenly.
pub(super) const SIDE: u32 = 16;

/// A rectangle of the image.
pub(super) struct Tile {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
}

/// A finished pixel.
pub(super) type Pixel = ([f32; 4], DataSample);

/// A tile's finished pixels, row by row.
pub(super) struct RenderedTile {
    pub(super) left: u32,
    pub(super) width: u32,
    pub(super) pixels: Vec<Pixel>,
    pub(super) counts: RayCounts,
}

impl Tile {
    /// Tile `column` of `band`; the last one may be narrower.
    pub(super) fn in_band(band: &Band<'_>, column: u32, settings: &RenderSettings) -> Self {
        let left = column * SIDE;
        Self {
            left,
            top: band.top,
            width: SIDE.min(settings.width - left),
            height: band.rows,
        }
    }

    /// Renders all pixels.
    pub(super) fn render<S: Surface, C: ShadeSource>(
        &self,
        tracer: &Tracer<'_, S, C>,
        settings: &RenderSettings,
    ) -> RenderedTile {
        let mut scratch = Scratch::default();
        let mut sampler = PixelSampler::new(settings.samples);
        let mut pixels = Vec::with_capacity(self.width as usize * self.height as usize);
        let size = Vec2::new(settings.width as f32, settings.height as f32);
        let share = 1.0 / settings.samples as f32;
        for y in self.top..self.top + self.height {
            for x in self.left..self.left + self.width {
                let mut sum = Vec3::ZERO;
                let mut coverage = 0.0;
                let mut data = DataSample::MISS;
                sampler.for_each(x, y, |point| {
                    let film_point = (Vec2::new(x as f32, y as f32) + point) / size;
                    let sample = tracer.sample(film_point, &mut scratch);
                    sum += sample.color;
                    coverage += sample.coverage;
                    data.keep_nearest(&sample.data);
                });
                let color = (sum * share).extend(coverage * share);
                pixels.push((color.to_array(), data));
            }
        }
        RenderedTile {
            left: self.left,
            width: self.width,
            pixels,
            counts: scratch.counts,
        }
    }
}
