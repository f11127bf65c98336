//! The accumulate stage: averages samples to pixels.

use std::ops::Range;

use super::{film::FilmTile, scratch::SampleGroup};
use crate::math::{LANES, Lanes, Lanes3, fold};

impl SampleGroup {
    /// Stores the mean of the `samples` of each pixel, and the data of the pixel.
    pub(super) fn accumulate(&self, samples: u32, tile: &mut FilmTile<'_>) {
        let (share, samples) = (1.0 / samples as f32, samples as usize);
        for (number, pixel) in self.pixels.iter().enumerate() {
            let range = number * samples..(number + 1) * samples;
            let sum = pixel_sum(&self.radiance, &self.coverage, range);
            tile.set_color(pixel.column, pixel.row, sum.map(|v| v * share));
            tile.set_data(pixel.column, pixel.row, &pixel.data);
        }
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

    #[test]
    fn sums_take_every_lane() {
        let lanes = std::array::from_fn(|lane| lane as f32);
        assert_eq!(sum_of_lanes(lanes), 120.0);
    }
}
