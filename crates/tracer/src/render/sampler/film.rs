//! Sample positions of a pixel on the film.
//!
//! The points of a pixel come from a table of correlated multi-jittered sets, selected by a hash of the pixel: as
//! well distributed as a separate set for every pixel, at a fraction of the cost.

use super::filter::{FilterTable, PixelFilter};
use super::hash::mix;
use super::multi_jitter::MultiJitter;

/// Maximum number of sets in a table.
const MAX_SETS: usize = 256;
/// Approximate number of points in a table; there are at least [`MIN_SETS`] sets.
const TABLE_POINTS: usize = 1 << 16;
/// Minimum number of sets in a table, for large sets.
const MIN_SETS: usize = 16;

/// Sample points for the pixels of a film.
#[derive(Debug, Clone)]
pub struct FilmSampler {
    samples: usize,
    /// Coordinates of the points of all sets, one set after the other.
    x: Vec<f32>,
    y: Vec<f32>,
}

impl FilmSampler {
    /// A sampler with `samples` points per pixel (at least one), all inside it.
    pub fn new(samples: u32) -> Self {
        Self::with_filter(samples, PixelFilter::BOX, 0)
    }

    /// A sampler with `samples` points per pixel (at least one), distributed like `filter` around its centre. Each
    /// `seed` has other sets of points.
    pub fn with_filter(samples: u32, filter: PixelFilter, seed: u32) -> Self {
        let table = (filter != PixelFilter::BOX && samples > 1).then(|| FilterTable::new(filter));
        let place = |u: f32| table.as_ref().map_or(u, |table| 0.5 + table.position(u));
        let mut sets = MultiJitter::new(samples);
        let count = set_count(samples);
        let samples = samples.max(1) as usize;
        let [mut x, mut y] = [(); 2].map(|()| Vec::with_capacity(count * samples));
        for set in (u64::from(seed) << 32..).take(count) {
            sets.for_each(set, |point| {
                x.push(place(point.x));
                y.push(place(point.y));
            });
        }
        Self { samples, x, y }
    }

    /// Memory of the points of a sampler with `samples` points per pixel.
    pub(in crate::render) fn bytes(samples: u32) -> u64 {
        (set_count(samples) * samples.max(1) as usize * size_of::<[f32; 2]>()) as u64
    }

    /// The points of pixel `(x, y)`, with coordinates in 0..1, or around that with a filter that is wider than the
    /// pixel. A single point is the centre of the pixel.
    pub fn points(&self, x: u32, y: u32) -> (&[f32], &[f32]) {
        self.points_of_pass(x, y, 0)
    }

    /// The points of a later pass over pixel `(x, y)`; 0 is [`Self::points`].
    pub(in crate::render) fn points_of_pass(&self, x: u32, y: u32, pass: u32) -> (&[f32], &[f32]) {
        let set = (self.set_of(x, y) + pass) as usize % (self.x.len() / self.samples);
        let range = set * self.samples..(set + 1) * self.samples;
        (&self.x[range.clone()], &self.y[range])
    }

    /// The number of the set of pixel `(x, y)`.
    pub fn set_of(&self, x: u32, y: u32) -> u32 {
        let sets = self.x.len() / self.samples;
        let hash = mix(u64::from(y) << 32 | u64::from(x)) >> 32;
        ((hash * sets as u64) >> 32) as u32
    }

    /// The points of all sets, one set after the other.
    pub fn all_points(&self) -> impl Iterator<Item = [f32; 2]> {
        self.x.iter().zip(&self.y).map(|(x, y)| [*x, *y])
    }
}

/// Number of sets of `samples` points in a table.
fn set_count(samples: u32) -> usize {
    (TABLE_POINTS / samples.max(1) as usize).clamp(MIN_SETS, MAX_SETS)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::render::sampler::FilterKind;

    #[test]
    fn pixels_use_complete_sample_sets() {
        for samples in [1, 3, 16, 4096] {
            let sampler = FilmSampler::new(samples);
            let mut sets = HashSet::new();
            for pixel in 0..2000 {
                let (x, y) = sampler.points(pixel, 7);
                assert_eq!((x.len(), y.len()), (samples as usize, samples as usize));
                let mean = y.iter().sum::<f32>() / samples as f32;
                assert!((mean - 0.5).abs() <= 0.5 / samples as f32 + 1e-5, "{samples}: {mean}");
                sets.insert(x[0].to_bits());
            }
            assert!(samples == 1 || sets.len() > 12, "{samples}: {}", sets.len());
        }
        assert_eq!(FilmSampler::new(1).points(3, 4), (&[0.5][..], &[0.5][..]));
    }

    #[test]
    fn seeds_have_other_sets() {
        let [first, second] =
            [0, 1].map(|seed| FilmSampler::with_filter(16, PixelFilter::BOX, seed));
        let of_second: HashSet<_> =
            second.all_points().map(|point| point.map(f32::to_bits)).collect();
        let shared =
            first.all_points().filter(|point| of_second.contains(&point.map(f32::to_bits)));
        assert_eq!(shared.count(), 0);
    }

    #[test]
    fn filters_spread_samples_around_the_pixel() {
        let filter = PixelFilter { kind: FilterKind::Gaussian, width: 3.0 };
        let centre = FilmSampler::with_filter(1, filter, 0);
        assert_eq!(centre.points(3, 4), (&[0.5][..], &[0.5][..]));
        let sampler = FilmSampler::with_filter(64, filter, 0);
        let (mut square, mut reach) = (0.0, 0.0_f32);
        for pixel in 0..256 {
            let (x, y) = sampler.points(pixel, 0);
            for offset in x.iter().chain(y).map(|at| at - 0.5) {
                square += offset * offset / (2.0 * 64.0 * 256.0);
                reach = reach.max(offset.abs());
            }
        }
        // The variance of a normal distribution that is cut off at two standard deviations of 3/4
        assert!((square - 0.773_7 * 0.562_5).abs() < 0.005, "{square}");
        assert!(reach > 1.3 && reach <= 1.5, "{reach}");
    }
}
