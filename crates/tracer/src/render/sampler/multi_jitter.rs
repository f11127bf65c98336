//! Point sets in a square.
//!
//! Correlated multi-jittered sampling for any count (Kensler, "Correlated multi-jittered sampling", Pixar technical
//! memo 13-01, 2013): `n` points are stratified in a grid of about sqrt(n) by sqrt(n) cells, and along each axis. The
//! shuffles come from a generator that is seeded with the index of the set, so its points depend on nothing else.

use glam::Vec2;

use super::hash::{STEP, mix};

/// A generator of point sets; it reuses its buffers.
#[derive(Debug, Clone)]
pub struct MultiJitter {
    samples: u32,
    column_order: Vec<u32>,
    row_order: Vec<u32>,
    random: SplitMix64,
}

impl MultiJitter {
    /// A generator of sets of `samples` points (at least one).
    pub fn new(samples: u32) -> Self {
        let samples = samples.max(1);
        let columns = samples.isqrt();
        let rows = samples.div_ceil(columns);
        Self {
            samples,
            column_order: (0..columns).collect(),
            row_order: (0..rows).collect(),
            random: SplitMix64(0),
        }
    }

    /// Calls `each` with the points of set number `set` in order, with coordinates in 0..1. A single point is exactly
    /// the centre.
    pub fn for_each(&mut self, set: u64, mut each: impl FnMut(Vec2)) {
        if self.samples == 1 {
            each(Vec2::splat(0.5));
            return;
        }
        self.random = SplitMix64(set);
        // Seed the shuffles. Consecutive set numbers are consecutive states, which would share outputs, so hash them
        // first
        self.random.0 = self.random.next();
        reorder(&mut self.column_order, &mut self.random);
        reorder(&mut self.row_order, &mut self.random);
        let columns = self.column_order.len();
        let rows = self.row_order.len();
        for (sample, index) in (0..self.samples).zip(0_usize..) {
            // Jitter the point in its cell
            let column = self.column_order[index % columns] as f32;
            let row = self.row_order[index / columns] as f32;
            // In x, every sample has a separate fine stratum: the part of a column that belongs to its row.
            let x = (column + (row + self.random.unit()) / rows as f32) / columns as f32;
            let y = (sample as f32 + self.random.unit()) / self.samples as f32;
            each(Vec2::new(x, y).min(Vec2::splat(1.0 - 0.5 * f32::EPSILON)));
        }
    }
}

/// A random permutation of `0..order.len()`, independent of the previous content (Fisher-Yates).
fn reorder(order: &mut [u32], random: &mut SplitMix64) {
    for (value, slot) in (0..).zip(order.iter_mut()) {
        *slot = value;
    }
    for last in (1..order.len()).rev() {
        order.swap(last, random.below(last + 1));
    }
}

/// SplitMix64 (Steele, Lea and Flood, 2014): small, fast, and of good quality for any seed.
#[derive(Debug, Clone, Copy)]
struct SplitMix64(u64);

impl SplitMix64 {
    const fn next(&mut self) -> u64 {
        let value = mix(self.0);
        self.0 = self.0.wrapping_add(STEP);
        value
    }

    /// A number in 0..1 in steps of 2^-24.
    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// An integer in 0..bound; the bias for the small bounds used here is below 2^-50.
    fn below(&mut self, bound: usize) -> usize {
        let wide = u128::from(self.next()) * bound as u128;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the product's upper half is below `bound`"
        )]
        let index = (wide >> 64) as usize;
        index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(samples: u32, set: u64) -> Vec<Vec2> {
        let mut points = Vec::new();
        MultiJitter::new(samples).for_each(set, |p| points.push(p));
        points
    }

    /// The number of `strata` equal parts of 0..1 that contain one of `values`.
    fn filled(values: impl Iterator<Item = f32>, strata: u32) -> usize {
        let mut parts: Vec<u32> = values.map(|v| stratum(v, strata)).collect();
        parts.sort_unstable();
        parts.dedup();
        parts.len()
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..strata")]
    fn stratum(value: f32, strata: u32) -> u32 {
        (value * strata as f32) as u32
    }

    #[test]
    fn one_sample_is_the_centre() {
        assert_eq!(points(1, 7), [Vec2::splat(0.5)]);
    }

    #[test]
    fn any_count_is_stratified_along_each_axis() {
        for samples in [2, 3, 4, 5, 7, 16, 17, 64, 100, 4096] {
            for set in [0, 1919, 65_535] {
                let points = points(samples, set);
                assert_eq!(points.len(), samples as usize);
                assert!(points.iter().all(|p| p.min_element() >= 0.0));
                assert!(points.iter().all(|p| p.max_element() < 1.0));
                let columns = samples.isqrt();
                let fine = columns * samples.div_ceil(columns);
                // 4096 strata are at the limit that rounding of the sums allows.
                let slack = usize::from(samples == 4096) * 4;
                let across = filled(points.iter().map(|p| p.x), fine);
                let down = filled(points.iter().map(|p| p.y), samples);
                assert!(across + slack >= samples as usize, "{samples}: {across}");
                assert!(down + slack >= samples as usize, "{samples}: {down}");
            }
        }
    }

    #[test]
    fn square_counts_fill_every_cell() {
        for side in [2, 4, 8] {
            let cells = points(side * side, 3);
            let cell = |p: &Vec2| (stratum(p.x, side), stratum(p.y, side));
            let mut occupied: Vec<_> = cells.iter().map(cell).collect();
            occupied.sort_unstable();
            occupied.dedup();
            assert_eq!(occupied.len(), cells.len());
        }
    }

    #[test]
    fn depends_on_the_set_and_on_nothing_else() {
        let mut sets = MultiJitter::new(16);
        sets.for_each(100, |_| ());
        let mut again = Vec::new();
        sets.for_each(3, |p| again.push(p));
        assert_eq!(again, points(16, 3));
        assert_ne!(again, points(16, 4));
    }

    #[test]
    fn means_are_unbiased_over_sets() {
        let mut sum = Vec2::ZERO;
        for x in 0..1000 {
            for p in points(5, x) {
                sum += p;
            }
        }
        // Standard error of a stratified mean here is under 0.003.
        let mean = sum / 5000.0;
        assert!((mean - 0.5).abs().max_element() < 0.01, "{mean}");
    }
}
