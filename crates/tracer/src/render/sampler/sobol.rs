//! Random numbers along paths: Sobol' points with Owen scrambling for each dimension.
//!
//! The first `2^k` samples of a dimension lie in `2^k` equal intervals of 0..1, whatever the scrambling, which is a
//! hash of the bits (Burley, "Practical hash-based Owen scrambling", Journal of Computer Graphics Techniques 9(4),
//! 2020).

use super::hash::mix;
use spherule_tree::math::{LANES, Lanes, lane_kernel};

/// Seed of the random numbers at one vertex of a path, for all samples of a pixel. Different paths are independent,
/// and so are different dimensions of a path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PathSeed(u64);

impl PathSeed {
    /// Seed of the paths of pixel `(x, y)`.
    pub fn of_pixel(x: u32, y: u32) -> Self {
        Self(mix(u64::from(y) << 32 | u64::from(x)))
    }

    /// The same path with other random numbers, those of sequence `seed`; 0 is the path itself.
    #[must_use]
    pub const fn in_sequence(self, seed: u32) -> Self {
        Self(self.0 ^ Self::sequence_bits(seed))
    }

    /// The same path with other random numbers, those of a later pass over the pixel; 0 is the path itself.
    #[must_use]
    pub(in crate::render) const fn in_pass(self, pass: u32) -> Self {
        match pass {
            0 => self,
            // Seeds of sequences are below
            _ => self.in_sequence(u32::MAX - pass),
        }
    }

    /// The bits by which [`Self::in_sequence`] changes seeds, on all devices: 0 for sequence 0, otherwise a hash.
    pub const fn sequence_bits(seed: u32) -> u64 {
        match seed {
            0 => 0,
            _ => mix(seed as u64),
        }
    }

    /// Seed of continuation `branch` of the path.
    #[must_use]
    pub fn child(self, branch: u32) -> Self {
        Self(mix(self.0.wrapping_add(u64::from(branch) + 1)))
    }

    /// The number of sample `sample` in dimension `dimension`, in 0..1 in steps of 2^-24.
    #[inline(always)]
    pub fn get_1d(self, dimension: u32, sample: u32) -> f32 {
        let [order, seed] = self.halves(dimension);
        // Each dimension has a different order; otherwise a sample would be low or high in all dimensions.
        let shuffled = scramble(sample, order);
        unit(scramble(shuffled.reverse_bits(), seed))
    }

    /// The numbers of sample `sample` in the pair of dimensions `dimension`. If the unit square is divided into `2^k`
    /// equal rectangles by repeated halving along either axis, each rectangle contains one of the first `2^k`
    /// samples.
    #[inline(always)]
    pub fn get_2d(self, dimension: u32, sample: u32) -> [f32; 2] {
        let [first, second] = self.halves(dimension);
        let shuffled = scramble(sample, first ^ second);
        [
            unit(scramble(shuffled.reverse_bits(), first)),
            unit(scramble(second_coordinate(shuffled), second)),
        ]
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "two halves")]
    fn halves(self, dimension: u32) -> [u32; 2] {
        let bits = mix(self.0 ^ mix(u64::from(dimension)));
        [bits as u32, (bits >> 32) as u32]
    }
}

/// [`PathSeed::get_1d`] for the paths of a packet.
#[inline(always)]
fn get_1d_body(seeds: &[PathSeed; LANES], dimension: u32, sample: &[u32; LANES], u: &mut Lanes) {
    for l in 0..LANES {
        u[l] = seeds[l].get_1d(dimension, sample[l]);
    }
}

lane_kernel! {
    pub(in crate::render) fn get_1d_lanes(
        seeds: &[PathSeed; LANES],
        dimension: u32,
        sample: &[u32; LANES],
        u: &mut Lanes,
    ) = get_1d_body;
}

/// [`PathSeed::get_2d`] for the paths of a packet.
#[inline(always)]
fn get_2d_body(
    seeds: &[PathSeed; LANES],
    dimension: u32,
    sample: &[u32; LANES],
    u: &mut [Lanes; 2],
) {
    for l in 0..LANES {
        [u[0][l], u[1][l]] = seeds[l].get_2d(dimension, sample[l]);
    }
}

lane_kernel! {
    pub(in crate::render) fn get_2d_lanes(
        seeds: &[PathSeed; LANES],
        dimension: u32,
        sample: &[u32; LANES],
        u: &mut [Lanes; 2],
    ) = get_2d_body;
}

/// The second coordinate of point `index` of the Sobol' sequence, as a fraction of 2^32: each bit is the parity of
/// some bits of the index, computed for all bits at once (Ahmed, "An implementation algorithm of 2D Sobol sequence
/// fast, elegant, and compact", 2024).
#[inline(always)]
fn second_coordinate(index: u32) -> u32 {
    // The bits of the index are a polynomial over GF(2). Substitute x + 1 for x, half by half
    let mut bits = index;
    bits ^= bits >> 16;
    bits ^= (bits & 0xff00_ff00) >> 8;
    bits ^= (bits & 0xf0f0_f0f0) >> 4;
    bits ^= (bits & 0xcccc_cccc) >> 2;
    bits ^= (bits & 0xaaaa_aaaa) >> 1;
    bits.reverse_bits()
}

/// Owen scrambling of a fraction of 2^32: each bit is flipped depending on a hash of the bits above it. On reversed
/// bits, that is a hash in which bits only affect higher ones; the constants are from a search by Vegdahl ("Building
/// a better LK hash", 2021).
#[inline(always)]
fn scramble(fraction: u32, seed: u32) -> u32 {
    let mut x = fraction.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[inline(always)]
fn unit(fraction: u32) -> f32 {
    (fraction >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..parts")]
    fn part(value: f32, parts: u32) -> u32 {
        (value * parts as f32) as u32
    }

    /// Whether each of `count` parts occurs once.
    fn is_permutation(parts: impl Iterator<Item = u32>, count: u32) -> bool {
        let mut parts: Vec<u32> = parts.collect();
        parts.sort_unstable();
        parts.into_iter().eq(0..count)
    }

    #[test]
    fn samples_are_stratified_in_one_dimension() {
        for (x, count) in [(0, 2), (1, 16), (7, 64), (9, 1024)] {
            let seed = PathSeed::of_pixel(x, 5).child(1);
            let parts = (0..count).map(|sample| part(seed.get_1d(3, sample), count));
            assert!(is_permutation(parts, count));
        }
    }

    #[test]
    fn samples_are_stratified_in_every_division_of_a_square() {
        for (x, bits) in [(0, 2), (1, 4), (2, 6), (3, 8)] {
            let seed = PathSeed::of_pixel(x, 1);
            let points: Vec<_> = (0..1 << bits).map(|s| seed.get_2d(0, s)).collect();
            for across in 0..=bits {
                let (columns, rows) = (1 << across, 1 << (bits - across));
                let cells = points.iter().map(|[x, y]| part(*x, columns) * rows + part(*y, rows));
                assert!(is_permutation(cells, 1 << bits), "{bits} {across}");
            }
        }
    }

    #[test]
    fn the_second_coordinate_is_that_of_its_direction_numbers() {
        for step in 0..4000_u32 {
            let index = step.wrapping_mul(0x9e37_79b9);
            let (mut rest, mut direction, mut sum) = (index, 1_u32 << 31, 0);
            while rest != 0 {
                sum ^= direction * (rest & 1);
                direction ^= direction >> 1;
                rest >>= 1;
            }
            assert_eq!(second_coordinate(index), sum, "{index}");
        }
    }

    #[test]
    fn dimensions_pixels_and_branches_are_independent() {
        let of_pixel = |x: u32| PathSeed::of_pixel(x, 0);
        let pairs: [fn(PathSeed) -> [f32; 2]; 3] = [
            |seed| [seed.get_1d(0, 3), seed.get_1d(1, 3)],
            |seed| [seed.get_1d(0, 3), seed.child(0).get_1d(0, 3)],
            |seed| [seed.child(0).get_1d(0, 3), seed.child(1).get_1d(0, 3)],
        ];
        for pair in pairs {
            let (mut mean, mut product) = ([0.0_f64; 2], 0.0);
            for x in 0..4096 {
                let [a, b] = pair(of_pixel(x)).map(f64::from);
                mean = [mean[0] + a / 4096.0, mean[1] + b / 4096.0];
                product += (a - 0.5) * (b - 0.5) / 4096.0;
            }
            // Standard errors are 0.0045 and 0.0013.
            assert!(mean.iter().all(|m| (m - 0.5).abs() < 0.02), "{mean:?}");
            assert!(product.abs() < 0.006, "{product}");
        }
    }

    #[test]
    fn sequences_are_independent() {
        assert_eq!(PathSeed::of_pixel(3, 4).in_sequence(0), PathSeed::of_pixel(3, 4));
        let (mut product, mut equal) = (0.0, 0);
        for x in 0..4096 {
            let seed = PathSeed::of_pixel(x, 0);
            let [a, b] = [1, 2].map(|sequence| seed.in_sequence(sequence).get_1d(0, 3));
            product += (f64::from(a) - 0.5) * (f64::from(b) - 0.5) / 4096.0;
            equal += u32::from(a == b);
        }
        // The standard error is 0.0013
        assert!(product.abs() < 0.006 && equal < 3, "{product} {equal}");
    }

    #[test]
    fn samples_are_not_low_or_high_in_all_dimensions() {
        let mut square = 0.0;
        for x in 0..256 {
            let seed = PathSeed::of_pixel(x, 3);
            let product = |s| f64::from((seed.get_1d(0, s) - 0.5) * (seed.get_1d(1, s) - 0.5));
            square += ((0..64).map(product).sum::<f64>() / 64.0).powi(2) / 256.0;
        }
        // 1.1e-4 if dimensions are independent, 4e-3 if they share their first bits.
        assert!(square < 2e-4, "{square}");
    }
}
