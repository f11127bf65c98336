//! The generate stage: sample positions on the film, and camera rays through them.

use super::{
    aov::DataSample,
    bodies::{TransmissiveBodies, lanes_inside_any},
    context::RenderContext,
    dimensions::{CAMERA, LENS, TIME},
    film::FilmTile,
    sampler::{PathSeed, get_1d_lanes, get_2d_lanes},
    scene_shapes::Interior,
    scratch::{Pixel, SampleGroup},
    settings::RenderSettings,
    shading::{camera_rays, lens_rays, moving_camera_rays, stereo_rays},
    stream::SegmentPacket,
    tile::mosaic_start,
};
use spherule_surface::Side;
use spherule_tree::math::{LANES, Lanes, first_lanes, lane3, lanes_in, splat};
use spherule_tree::ray::RayPacket;

impl RenderContext<'_> {
    /// Generates the samples of `pixels` (columns and rows of `tile`).
    pub(super) fn place_samples(
        &self,
        tile: &FilmTile<'_>,
        pixels: impl Iterator<Item = (u32, u32)>,
        group: &mut SampleGroup,
    ) {
        group.clear();
        group.layers.channels = self.settings.channels;
        group.layers.layers = self.settings.channels.layers;
        group.layers.background_group = self.background_group();
        let [left, top] = self.first_pixel(tile);
        let eye_size = self.settings.eye_size(self.scene.camera.eyes()).map(u32::cast_signed);
        for (column, row) in pixels {
            let (x, y) = (left + column.cast_signed(), top + row.cast_signed());
            // Numbers of pixels beyond the left or top border wrap around; they only select random numbers
            let [column_number, row_number] = [x, y].map(i32::cast_unsigned);
            // The image of the right eye is beside that of the left one, or below it
            let is_right = self.cameras.now.is_stereo() && (x >= eye_size[0] || y >= eye_size[1]);
            group.pixels.push(Pixel {
                column,
                row,
                side: match (self.cameras.now.is_stereo(), is_right) {
                    (false, _) => 0.0,
                    (true, false) => -1.0,
                    (true, true) => 1.0,
                },
                path: PathSeed::of_pixel(column_number, row_number)
                    .in_sequence(self.settings.seed)
                    .in_pass(group.pass),
                data: DataSample::MISS,
            });
            // Add the samples of the pixel, relative to the image of its eye
            let points = self.sampler.points_of_pass(column_number, row_number, group.pass);
            let [x, y] = if is_right { [x % eye_size[0], y % eye_size[1]] } else { [x, y] };
            group.push_pixel(x as f32, y as f32, points);
        }
    }

    /// The first pixel of `tile` in the image of the camera.
    fn first_pixel(&self, tile: &FilmTile<'_>) -> [i32; 2] {
        let RenderSettings { width, height, .. } = *self.settings;
        let [left, top] = match self.settings.mosaic_of {
            None => [tile.left, tile.top],
            Some([full_width, full_height]) => [
                mosaic_start(tile.left, width, full_width),
                mosaic_start(tile.top, height, full_height),
            ],
        };
        let window = self.settings.data_window();
        [left.cast_signed() + window.left, top.cast_signed() + window.top]
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
        let first = number * LANES;
        let len = LANES.min(group.len - first);
        let (simd, rays) = (self.simd, &mut segments.rays);
        match &self.cameras.exposure {
            None => camera_rays(simd, &self.cameras.now, x, y, rays),
            Some([open, close]) => {
                self.sample_times(group, first, len, &mut rays.time);
                moving_camera_rays(simd, open, close, x, y, rays);
            }
        }
        rays.set_len(len);
        if self.cameras.now.is_stereo() {
            let side = self.sides(group, first, len);
            stereo_rays(simd, &self.cameras.now, &side, rays);
        }
        if self.cameras.now.has_lens() {
            let u = self.lens_samples(group, first, len);
            lens_rays(simd, &self.cameras.now, &u, rays);
        }
        // Initialise their path state
        segments.throughput = [splat(1.0); 3];
        segments.pdf = splat(f32::INFINITY);
        segments.bounces = [0; LANES];
        #[expect(clippy::cast_possible_truncation, reason = "groups are small")]
        let sample = std::array::from_fn(|lane| (first + lane) as u32);
        segments.sample = sample;
        match &self.shapes.nested {
            None => segments.inside = self.lanes_inside(&segments.rays),
            Some(nested) => self.find_bodies(nested, segments),
        }
        if seeds {
            let samples = self.settings.samples as usize;
            for (lane, path) in segments.path.iter_mut().enumerate().take(len) {
                *path = group.pixels[(first + lane) / samples].path;
            }
        }
    }

    /// The eyes that see the `len` samples of `group` from `first` on.
    fn sides(&self, group: &SampleGroup, first: usize, len: usize) -> Lanes {
        let (samples, mut sides) = (self.settings.samples as usize, splat(0.0));
        for (lane, side) in sides.iter_mut().enumerate().take(len) {
            *side = group.pixels[(first + lane) / samples].side;
        }
        sides
    }

    /// Points in the unit square for the lens, of the `len` samples of `group` from `first` on.
    fn lens_samples(&self, group: &SampleGroup, first: usize, len: usize) -> [Lanes; 2] {
        let (seeds, sample) = self.camera_seeds(group, first, len);
        let mut u = [splat(0.0); 2];
        get_2d_lanes(self.simd, &seeds, LENS, &sample, &mut u);
        u
    }

    /// Times of the `len` samples of `group` from `first` on, while the shutter is open.
    fn sample_times(&self, group: &SampleGroup, first: usize, len: usize, time: &mut Lanes) {
        let (seeds, sample) = self.camera_seeds(group, first, len);
        get_1d_lanes(self.simd, &seeds, TIME, &sample, time);
        for time in time {
            *time -= 0.5;
        }
    }

    /// Seeds of the random numbers of camera rays, and the numbers of their samples in the pixels, for the `len`
    /// samples of `group` from `first` on.
    fn camera_seeds(
        &self,
        group: &SampleGroup,
        first: usize,
        len: usize,
    ) -> ([PathSeed; LANES], [u32; LANES]) {
        let samples = self.settings.samples as usize;
        let (mut seeds, mut sample) = ([PathSeed::default(); LANES], [0; LANES]);
        for lane in 0..len {
            let number = first + lane;
            seeds[lane] = group.pixels[number / samples].path.child(CAMERA);
            #[expect(clippy::cast_possible_truncation, reason = "at most 4096 samples")]
            let index = (number % samples) as u32;
            sample[lane] = index;
        }
        (seeds, sample)
    }

    /// Finds the bodies of `nested` in which the camera rays of `segments` start.
    fn find_bodies(&self, nested: &TransmissiveBodies<'_>, segments: &mut SegmentPacket) {
        segments.bodies = [self.camera_bodies; LANES];
        if !self.cameras.now.has_one_origin() {
            for lane in lanes_in(segments.lanes()) {
                segments.bodies[lane] = nested.at(lane3(&segments.rays.origin, lane));
            }
        }
        segments.inside = segments.lanes() & lanes_inside_any(&segments.bodies);
    }

    /// Lanes of the camera rays that start inside the only connected body.
    fn lanes_inside(&self, rays: &RayPacket) -> u32 {
        let lanes = first_lanes(rays.len());
        match (self.cameras.now.has_one_origin(), self.shapes.particles) {
            (false, Some(body)) if self.shapes.interior == Interior::Body => {
                let is_inside = |lane| body.side_of(lane3(&rays.origin, lane)) == Side::Inside;
                lanes_in(lanes).mask_where(is_inside)
            }
            _ if self.is_camera_inside => lanes,
            _ => 0,
        }
    }
}
