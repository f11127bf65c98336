//! Seeded particle sets for measurements.
//!
//! The box is the thesis's scene. It is filled with splitmix64, a generator of three lines, so that other
//! programs can generate exactly the same particles and be compared.

use glam::Vec3;
use rayon::prelude::*;

/// A box with a uniform random distribution of particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxSettings {
    /// Number of particles.
    pub count: usize,
    /// Seed: the initial state of the generator.
    pub seed: u64,
    /// Smallest corner, scene units.
    pub min: Vec3,
    /// Largest corner, scene units.
    pub max: Vec3,
}

impl BoxSettings {
    /// The thesis's box, (3, 5, -2) to (7, 8, 2).
    pub const fn thesis(count: usize, seed: u64) -> Self {
        Self { count, seed, min: Vec3::new(3.0, 5.0, -2.0), max: Vec3::new(7.0, 8.0, 2.0) }
    }
}

/// The particles of `settings`. The x, y and z of each particle are three successive numbers of splitmix64:
/// `min + ((next >> 40) * 2^-24) * (max - min)` in f32.
///
/// ```
/// use spherule_frame::generate::{BoxSettings, fill_box};
///
/// let settings = BoxSettings::thesis(1000, 1);
/// let centers = fill_box(&settings);
/// assert_eq!(centers.len(), 1000);
/// assert!(centers.iter().all(|c| c.cmpge(settings.min).all() && c.cmple(settings.max).all()));
/// ```
pub fn fill_box(settings: &BoxSettings) -> Vec<Vec3> {
    (0..settings.count).into_par_iter().map(|index| settings.particle(index as u64)).collect()
}

impl BoxSettings {
    /// Particle `index` of [`fill_box`]. The state of the generator is a counter, so that each particle can be
    /// computed alone.
    #[inline]
    pub fn particle(&self, index: u64) -> Vec3 {
        let first = index.wrapping_mul(3);
        let unit = [1, 2, 3].map(|k| unit(splitmix64(self.seed, first.wrapping_add(k))));
        self.min + Vec3::from_array(unit) * (self.max - self.min)
    }
}

/// Number `n` (from 1) of splitmix64 with the initial state `seed`.
pub fn splitmix64(seed: u64, n: u64) -> u64 {
    const STEP: u64 = 0x9E37_79B9_7F4A_7C15;
    let state = seed.wrapping_add(n.wrapping_mul(STEP));
    let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The upper 24 bits as a number from 0 to 1 (exclusive), exact in f32.
pub fn unit(bits: u64) -> f32 {
    const SCALE: f32 = 1.0 / 16_777_216.0;
    #[expect(clippy::cast_precision_loss, reason = "24 bits fit")]
    {
        (bits >> 40) as f32 * SCALE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first outputs for seed 1234567, as published with the generator.
    #[test]
    fn the_generator_is_splitmix64() {
        let expected = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
        ];
        assert_eq!([1, 2, 3, 4].map(|n| splitmix64(1_234_567, n)), expected);
    }

    #[test]
    fn parallel_box_equals_the_serial_one() {
        let settings = BoxSettings::thesis(1000, 7);
        let mut state = settings.seed;
        let mut next = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            unit(z ^ (z >> 31))
        };
        for point in fill_box(&settings) {
            let expected = [next() * 4.0 + 3.0, next() * 3.0 + 5.0, next() * 4.0 - 2.0];
            assert_eq!(point.to_array(), expected);
            assert!(point.cmpge(settings.min).all() && point.cmple(settings.max).all());
        }
        assert!(fill_box(&BoxSettings { count: 0, ..settings }).is_empty());
    }
}
