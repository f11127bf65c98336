//! Tiles whose samples are traced one by one by recursion: transmissive surfaces, whose rays split.

use glam::{Vec2, Vec4};

use super::{
    RayCounts, RenderSettings, ShadeSource, Stop,
    aov::DataSample,
    film::FilmTile,
    sampler::PixelSampler,
    tile::pixels_of,
    tracer::{Scratch, Tracer},
};
use crate::ray::PACKET_SIZE;
use crate::surface::Surface;

/// Renders all pixels of `tile`, samples in packets of 16. None once `stop` is raised.
pub(super) fn render_tile<S: Surface, C: ShadeSource>(
    tracer: &Tracer<'_, S, C>,
    settings: &RenderSettings,
    stop: &dyn Stop,
    tile: &mut FilmTile<'_>,
) -> Option<RayCounts> {
    let mut scratch = Scratch::default();
    let mut sampler = PixelSampler::new(settings.samples);
    let count = tile.width as usize * tile.rows as usize;
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
    for (column, row) in pixels_of(tile) {
        let pixel = (row * tile.width + column) as usize;
        let (x, y) = (tile.left + column, tile.top + row);
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
    let width = tile.width;
    for (pixel, (sum, data)) in (0..).zip(pixels) {
        tile.set_color(pixel % width, pixel / width, (sum * share).to_array());
        tile.set_data(pixel % width, pixel / width, &data);
    }
    Some(scratch.counts)
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
