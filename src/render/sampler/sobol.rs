//! Numbers for what is drawn along a path: Sobol' points, scrambled in Owen's way for each dimension.
//!
//! The first `2^k` samples of a dimension lie in `2^k` equal parts of 0..1, whatever the scrambling. It is done by a
//! hash of the bits (Burley, "Practical hash-based Owen scrambling", Journal of Computer Graphics Techniques 9(4),
//! 2020).

use super::hash::mix;

/// What is drawn at one place of a path, for all samples of a pixel. Dimensions of different paths, and different
/// dimensions of one, have nothing to do with each other.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PathSeed(u64);

impl PathSeed {
    /// Of the paths that begin at pixel `(x, y)`.
    pub fn of_pixel(x: u32, y: u32) -> Self {
        Self(mix(u64::from(y) << 32 | u64::from(x)))
    }

    /// Of the path's continuation number `branch`.
    #[must_use]
    pub fn child(self, branch: u32) -> Self {
        Self(mix(self.0.wrapping_add(u64::from(branch) + 1)))
    }

    /// The number of sample `sample` in dimension `dimension`, in 0..1 in steps of 2^-24.
    pub fn get_1d(self, dimension: u32, sample: u32) -> f32 {
        let [order, seed] = self.halves(dimension);
        // In another order for each dimension, or samples would be low or high in all of them.
        let shuffled = scrambled(sample, order);
        unit(scrambled(shuffled.reverse_bits(), seed))
    }

    #[expect(clippy::cast_possible_truncation, reason = "two halves")]
    fn halves(self, dimension: u32) -> [u32; 2] {
        let bits = mix(self.0 ^ mix(u64::from(dimension)));
        [bits as u32, (bits >> 32) as u32]
    }
}

/// Owen's scrambling of a fraction of 2^32: each bit is turned or not by a hash of the bits above it. In reverse that is
/// a hash in which bits change higher ones only; the constants were searched by Vegdahl ("Building a better LK hash",
/// 2021).
fn scrambled(fraction: u32, seed: u32) -> u32 {
    let mut x = fraction.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

fn unit(fraction: u32) -> f32 {
    (fraction >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "in 0..parts"
    )]
    fn part(value: f32, parts: u32) -> u32 {
        (value * parts as f32) as u32
    }

    /// Whether each of `count` parts is named once.
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
    fn samples_are_not_low_or_high_in_all_dimensions() {
        let mut square = 0.0;
        for x in 0..256 {
            let seed = PathSeed::of_pixel(x, 3);
            let product = |s| f64::from((seed.get_1d(0, s) - 0.5) * (seed.get_1d(1, s) - 0.5));
            square += ((0..64).map(product).sum::<f64>() / 64.0).powi(2) / 256.0;
        }
        // 1.1e-4 if nothing is common, 4e-3 if the first bits are.
        assert!(square < 2e-4, "{square}");
    }
}
