//! Pixel filters: how the samples of a pixel are distributed around its centre.
//!
//! Samples are placed with the density of the filter, so all have the same weight (Ernst, Stamminger and Greiner,
//! "Filter importance sampling", 2006). A sample belongs to one pixel only, so pixels stay independent.

use std::f64::consts::PI;

/// Kinds of filters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum FilterKind {
    /// The same weight everywhere.
    #[default]
    Box,
    /// A normal distribution with a standard deviation of a quarter of the width, cut off at two of them.
    Gaussian,
    /// The window with four terms of Harris ("On the use of windows for harmonic analysis with the discrete Fourier
    /// transform", 1978).
    BlackmanHarris,
}

impl FilterKind {
    /// The usual width in pixels.
    pub const fn default_width(self) -> f32 {
        match self {
            Self::Box => 1.0,
            Self::Gaussian => 2.0,
            Self::BlackmanHarris => 3.0,
        }
    }
}

/// Maximum width of a filter in pixels.
pub const MAX_FILTER_WIDTH: f32 = 16.0;

/// A separable filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelFilter {
    /// The function.
    pub kind: FilterKind,
    /// Extent on each axis in pixels.
    pub width: f32,
}

impl PixelFilter {
    /// The pixel itself.
    pub const BOX: Self = Self { kind: FilterKind::Box, width: 1.0 };

    /// The filter at distance `x` from its centre along one axis, relative to its maximum.
    pub(super) fn value(self, x: f64) -> f64 {
        // Position in -1/2 to 1/2
        let x = x / f64::from(self.width);
        if x.abs() > 0.5 {
            return 0.0;
        }
        match self.kind {
            FilterKind::Box => 1.0,
            FilterKind::Gaussian => libm::exp(-8.0 * x * x),
            FilterKind::BlackmanHarris => {
                let cosine = |k: f64| libm::cos(2.0 * PI * k * x);
                0.358_75 + 0.488_29 * cosine(1.0) + 0.141_28 * cosine(2.0) + 0.011_68 * cosine(3.0)
            }
        }
    }
}

/// Number of intervals of a table.
const INTERVALS: usize = 1024;

/// Maps uniform numbers to positions with the density of a filter.
pub(super) struct FilterTable {
    /// Integral of the filter from its centre to the ends of equal intervals, relative to the whole half.
    integral: Vec<f64>,
    half_width: f64,
}

impl FilterTable {
    pub(super) fn new(filter: PixelFilter) -> Self {
        let half_width = 0.5 * f64::from(filter.width);
        let step = half_width / INTERVALS as f64;
        let mut integral = vec![0.0];
        let mut sum = 0.0;
        for number in 0..INTERVALS {
            sum += filter.value((number as f64 + 0.5) * step);
            integral.push(sum);
        }
        integral.iter_mut().for_each(|part| *part /= sum);
        Self { integral, half_width }
    }

    /// The distance from the centre for `u` in 0..1; it grows with `u`.
    #[expect(clippy::cast_possible_truncation, reason = "a distance in pixels")]
    pub(super) fn position(&self, u: f32) -> f32 {
        let u = 2.0 * f64::from(u) - 1.0;
        let part = u.abs();
        // Find the interval that the integral reaches `part` in
        let end = self.integral.partition_point(|sum| *sum < part).clamp(1, INTERVALS);
        let (low, high) = (self.integral[end - 1], self.integral[end]);
        let inside = ((part - low) / (high - low)).clamp(0.0, 1.0);
        let distance = self.half_width * ((end - 1) as f64 + inside) / INTERVALS as f64;
        (u.signum() * distance) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTERS: [PixelFilter; 3] = [
        PixelFilter { kind: FilterKind::Box, width: 1.5 },
        PixelFilter { kind: FilterKind::Gaussian, width: 2.0 },
        PixelFilter { kind: FilterKind::BlackmanHarris, width: 3.0 },
    ];

    #[test]
    fn positions_have_the_density_of_the_filter() {
        for filter in FILTERS {
            let table = FilterTable::new(filter);
            let (bins, count) = (20_usize, 200_000_usize);
            let mut found = vec![0.0; bins];
            for number in 0..count {
                let u = (number as f64 + 0.5) / count as f64;
                #[expect(clippy::cast_possible_truncation, reason = "as the sampler has it")]
                let position = f64::from(table.position(u as f32)) / f64::from(filter.width) + 0.5;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..1")]
                let bin = (position * bins as f64) as usize;
                found[bin.min(bins - 1)] += 1.0 / count as f64;
            }
            // Integrate the filter over the bins with Simpson's rule
            let edge = |at: f64| f64::from(filter.width) * (at / bins as f64 - 0.5);
            let part = |bin: usize| {
                let at = bin as f64;
                let [low, middle, high] = [at, at + 0.5, at + 1.0].map(|at| filter.value(edge(at)));
                low + 4.0 * middle + high
            };
            let total: f64 = (0..bins).map(part).sum();
            for (bin, found) in found.iter().enumerate() {
                let expected = part(bin) / total;
                assert!((found - expected).abs() < 2e-4, "{filter:?} {bin}: {found} {expected}");
            }
        }
    }

    #[test]
    fn positions_are_symmetric_and_within_the_width() {
        for filter in FILTERS {
            let table = FilterTable::new(filter);
            assert_eq!(table.position(0.5), 0.0);
            assert_eq!(table.position(0.0), -0.5 * filter.width);
            let mut last = -filter.width;
            for number in 0..=64_u8 {
                let u = f32::from(number) / 64.0;
                let position = table.position(u);
                assert_eq!(position, -table.position(1.0 - u));
                assert!(position > last && position <= 0.5 * filter.width, "{u}");
                last = position;
            }
        }
    }
}
