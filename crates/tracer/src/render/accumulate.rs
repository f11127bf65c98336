//! The accumulate stage: averages samples to pixels.

use std::ops::Range;

use glam::Vec3;

use super::{
    film::{FilmTile, bounded},
    scratch::SampleGroup,
};
use spherule_tree::math::{LANES, Lanes, Lanes3, fold, lane3};

impl SampleGroup {
    /// Stores the mean of the `samples` of each pixel, and the data of the pixel. `is_bounded`: samples may have
    /// negative radiance, or a coverage outside 0 to 1, but pixels may not.
    pub(super) fn accumulate(&mut self, samples: u32, is_bounded: bool, tile: &mut FilmTile<'_>) {
        let (share, samples) = (1.0 / samples as f32, samples as usize);
        let mut layers = std::mem::take(&mut self.layers);
        for (number, pixel) in self.pixels.iter().enumerate() {
            let range = number * samples..(number + 1) * samples;
            // Average the radiance and the coverage
            let sum = pixel_sum(&self.radiance, &self.coverage, range.clone());
            let mean = sum.map(|v| v * share);
            let color = bounded(mean, is_bounded);
            // Store them with the data of the pixel, the mean of odd samples for the denoiser, and the layers
            tile.set_color(pixel.column, pixel.row, color);
            tile.set_data(pixel.column, pixel.row, &pixel.data);
            if tile.has_odd() || self.noise.is_some() {
                let odd = self.odd_mean(number * samples, samples);
                tile.set_odd(pixel.column, pixel.row, bounded(odd, is_bounded));
                if let Some(noise) = &mut self.noise {
                    noise.add(mean, odd);
                }
            }
            if !layers.is_empty() {
                let pixel = (&mut *tile, [pixel.column, pixel.row]);
                layers.accumulate(range, &self.coverage, (mean, color), pixel);
            }
        }
        self.layers = layers;
    }

    /// The mean of every second of the `samples` from `first + 1` on.
    fn odd_mean(&self, first: usize, samples: usize) -> [f32; 4] {
        let odd = (first + 1..first + samples).step_by(2);
        let share = (samples / 2).max(1) as f32;
        let radiance = |sample: usize| lane3(&self.radiance[sample / LANES], sample % LANES);
        let mean = odd.clone().map(radiance).sum::<Vec3>() / share;
        let covered = |sample: usize| self.coverage[sample / LANES][sample % LANES];
        let coverage = odd.map(covered).sum::<f32>() / share;
        mean.extend(coverage).to_array()
    }
}

/// The sum of the samples in `range`: packet by packet if a pixel has whole packets, otherwise one by one. In both
/// cases the sum does not depend on the position of the pixel in the group.
fn pixel_sum(radiance: &[Lanes3], coverage: &[Lanes], range: Range<usize>) -> [f32; 4] {
    let mut sum = [0.0; 4];
    if range.len().is_multiple_of(LANES) {
        for packet in range.start / LANES..range.end / LANES {
            for axis in 0..3 {
                sum[axis] += sum_of_lanes(radiance[packet][axis]);
            }
            sum[3] += sum_of_lanes(coverage[packet]);
        }
        return sum;
    }
    for sample in range {
        let (packet, lane) = (sample / LANES, sample % LANES);
        for axis in 0..3 {
            sum[axis] += radiance[packet][axis][lane];
        }
        sum[3] += coverage[packet][lane];
    }
    sum
}

/// The sum over the lanes of a packet.
#[inline(always)]
fn sum_of_lanes(lanes: Lanes) -> f32 {
    fold(lanes, |a, b| a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::aov::DataSample;
    use crate::render::channels::Channels;
    use crate::render::film::Film;
    use crate::render::sampler::PathSeed;
    use crate::render::scratch::Pixel;

    #[test]
    fn odd_samples_are_averaged_separately() {
        let mut film = Film::default();
        film.fit(1, 1, Channels::COLOR, true);
        let mut group = SampleGroup::default();
        group.pixels.push(Pixel {
            column: 0,
            row: 0,
            side: 0.0,
            path: PathSeed::of_pixel(0, 0),
            data: DataSample::MISS,
        });
        for (sample, radiance) in [1.0, 10.0, 100.0, 1000.0, 10_000.0].into_iter().enumerate() {
            group.push(0.0, 0.0);
            group.radiance[0][0][sample] = radiance;
        }
        let mut bands = film.bands_mut(1);
        group.accumulate(5, false, &mut bands[0].tiles(1)[0]);
        drop(bands);
        assert_eq!(film.odd, Some(vec![[505.0, 0.0, 0.0, 0.0]]));
        assert!((film.color[0][0] - 2222.2).abs() < 0.01);
    }

    #[test]
    fn sums_take_every_lane() {
        let lanes = std::array::from_fn(|lane| lane as f32);
        assert_eq!(sum_of_lanes(lanes), 120.0);
    }
}
