//! A square of pixels rendered by one thread.

use glam::{Vec2, Vec4};

use super::{
    RayCounts, RenderSettings, ShadeSource, Stop,
    aov::DataSample,
    film::Band,
    sampler::PixelSampler,
    tracer::{Scratch, Tracer},
};
use crate::ray::PACKET_SIZE;
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

    /// Renders all pixels. Samples go in packets of 16, pixel after pixel along a Z-order curve: a
    /// packet is a square of 4x4 pixels, or the samples of a smaller one. None once `stop` is raised.
    pub(super) fn render<S: Surface, C: ShadeSource>(
        &self,
        tracer: &Tracer<'_, S, C>,
        settings: &RenderSettings,
        stop: &dyn Stop,
    ) -> Option<RenderedTile> {
        let mut scratch = Scratch::default();
        let mut sampler = PixelSampler::new(settings.samples);
        let count = self.width as usize * self.height as usize;
        let mut pixels = vec![(Vec4::ZERO, DataSample::MISS); count];
        let mut packet = SamplePacket::default();
        let mut is_stopped = stop.is_raised();
        let mut flush = |packet: &mut SamplePacket| {
            // What a sample takes is bounded, what a pixel takes hardly is.
            is_stopped = is_stopped || stop.is_raised();
            if is_stopped {
                packet.len = 0;
                return;
            }
            tracer.samples(packet.films(), &mut scratch, |lane, sample| {
                let (sum, data) = &mut pixels[packet.pixels[lane]];
                *sum += sample.color.extend(sample.coverage);
                data.keep_nearest(&sample.data);
            });
            packet.len = 0;
        };
        let size = Vec2::new(settings.width as f32, settings.height as f32);
        for (column, row) in z_order().filter(|(x, y)| *x < self.width && *y < self.height) {
            let pixel = (row * self.width + column) as usize;
            let (x, y) = (self.left + column, self.top + row);
            sampler.for_each(x, y, |point| {
                let film = (Vec2::new(x as f32, y as f32) + point) / size;
                packet.push(pixel, film);
                if packet.len == PACKET_SIZE {
                    flush(&mut packet);
                }
            });
        }
        flush(&mut packet);
        if is_stopped {
            return None;
        }
        let share = 1.0 / settings.samples as f32;
        let mean = |(sum, data): (Vec4, DataSample)| ((sum * share).to_array(), data);
        Some(RenderedTile {
            left: self.left,
            width: self.width,
            pixels: pixels.into_iter().map(mean).collect(),
            counts: scratch.counts,
        })
    }
}

/// Samples to be traced together.
#[derive(Default)]
struct SamplePacket {
    /// The pixel of each, within the tile.
    pixels: [usize; PACKET_SIZE],
    films: [Vec2; PACKET_SIZE],
    len: usize,
}

impl SamplePacket {
    fn push(&mut self, pixel: usize, film: Vec2) {
        self.pixels[self.len] = pixel;
        self.films[self.len] = film;
        self.len += 1;
    }

    fn films(&self) -> &[Vec2] {
        &self.films[..self.len]
    }
}

/// Column and row of the places in a whole tile, so that every aligned square of a power of two is
/// finished before the next one is begun.
fn z_order() -> impl Iterator<Item = (u32, u32)> {
    const { assert!(SIDE == 16, "four bits for each axis") };
    let every_other_bit = |code: u32| (0..4).fold(0, |v, bit| v | (code >> bit & 1 << bit));
    (0..SIDE * SIDE).map(move |code| (every_other_bit(code), every_other_bit(code >> 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_places_are_a_square() {
        let places: Vec<_> = z_order().collect();
        for packet in places.chunks(PACKET_SIZE) {
            let (x, y) = packet[0];
            assert_eq!((x % 4, y % 4), (0, 0));
            assert!(packet.iter().all(|(a, b)| a - x < 4 && b - y < 4));
        }
        let mut sorted = places;
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 256);
    }
}
