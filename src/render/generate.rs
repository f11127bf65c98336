//! The generate stage: sample positions on the film, and camera rays through them.

use super::{
    aov::DataSample,
    context::RenderContext,
    film::FilmTile,
    sampler::PathSeed,
    scratch::{Pixel, SampleGroup},
    settings::RenderSettings,
    shading::camera_rays,
    stream::SegmentPacket,
    tile::mosaic_start,
};
use crate::math::{LANES, first_lanes, splat};

impl RenderContext<'_> {
    /// Generates the samples of `pixels` (columns and rows of `tile`).
    pub(super) fn place_samples(
        &self,
        tile: &FilmTile<'_>,
        pixels: impl Iterator<Item = (u32, u32)>,
        group: &mut SampleGroup,
    ) {
        group.clear();
        group.layers.layers = self.settings.channels.layers;
        let [left, top] = self.first_pixel(tile);
        for (column, row) in pixels {
            let (x, y) = (left + column, top + row);
            group.pixels.push(Pixel {
                column,
                row,
                path: PathSeed::of_pixel(x, y),
                data: DataSample::MISS,
            });
            group.push_pixel(x as f32, y as f32, self.sampler.points(x, y));
        }
    }

    /// The first pixel of `tile` in the image of the camera.
    fn first_pixel(&self, tile: &FilmTile<'_>) -> [u32; 2] {
        let RenderSettings { width, height, .. } = *self.settings;
        match self.settings.mosaic_of {
            None => [tile.left, tile.top],
            Some([full_width, full_height]) => [
                mosaic_start(tile.left, width, full_width),
                mosaic_start(tile.top, height, full_height),
            ],
        }
    }

    /// Generates the camera rays of packet `number` of a group, and the seeds of their paths if `seeds` is set.
    pub(super) fn camera_segments(
        &self,
        group: &SampleGroup,
        number: usize,
        seeds: bool,
        segments: &mut SegmentPacket,
    ) {
        // Generate the rays
        let [x, y] = &group.film[number];
        camera_rays(self.simd, &self.camera, x, y, &mut segments.rays);
        let first = number * LANES;
        let len = LANES.min(group.len - first);
        segments.rays.set_len(len);
        // Initialise their path state
        segments.throughput = [splat(1.0); 3];
        segments.pdf = splat(f32::INFINITY);
        segments.bounces = [0; LANES];
        #[expect(clippy::cast_possible_truncation, reason = "groups are small")]
        let sample = std::array::from_fn(|lane| (first + lane) as u32);
        segments.sample = sample;
        segments.inside = if self.is_camera_inside {
            first_lanes(len)
        } else {
            0
        };
        if seeds {
            let samples = self.settings.samples as usize;
            for (lane, path) in segments.path.iter_mut().enumerate().take(len) {
                *path = group.pixels[(first + lane) / samples].path;
            }
        }
    }
}
