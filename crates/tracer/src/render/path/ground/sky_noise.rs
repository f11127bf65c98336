//! Removes noise from the map of the light of the environment: an à-trous filter whose weights fall with the difference
//! of texels relative to their noise (Dammertz and others, "Edge-avoiding à-trous wavelet transform for fast global
//! illumination filtering", 2010; the noise as in Schied and others, "Spatiotemporal variance-guided filtering", 2017).

use glam::Vec3;
use rayon::prelude::*;

/// Distances of neighbours in the passes, texels.
const STEPS: [usize; 3] = [1, 2, 4];

/// Weights of neighbours on an axis: a cubic B-spline.
const SPLINE: [f32; 5] = [0.0625, 0.25, 0.375, 0.25, 0.0625];

/// Texels of the neighbourhood of one.
const NEIGHBOURS: usize = SPLINE.len() * SPLINE.len();

/// Standard deviations of the difference of two texels from which on these are not averaged. With 3, caustics of soft
/// lights fade.
const LARGEST_DIFFERENCE: f32 = 2.0;

/// Memory for each texel of a map, beside two copies of it, bytes.
pub(super) const BYTES: usize = (NEIGHBOURS + 4) * size_of::<f32>();

/// Texels of a square map, with an estimate of their noise.
pub(super) struct NoisyMap {
    /// Means of the paths of each texel.
    pub(super) texels: Vec<Vec3>,
    /// Means of every second path, minus those of the others.
    pub(super) differences: Vec<Vec3>,
}

/// Removes noise from `map`, and the same from maps of its parts: they still add up to it.
pub(super) fn remove_noise(map: NoisyMap, parts: &mut [Vec<Vec3>], side: usize) -> Vec<Vec3> {
    let NoisyMap { mut texels, differences } = map;
    // The mean of two halves has half of their difference
    let squares: Vec<f32> = differences.iter().map(|d| (0.5 * mean_of(*d)).powi(2)).collect();
    let mut variances = averaged(&squares, &Weights::new(side, 1, |_, _| 1.0));
    for step in STEPS {
        let weights = similar_weights(&texels, &variances, side, step);
        texels = averaged(&texels, &weights);
        for part in &mut *parts {
            *part = averaged(part, &weights);
        }
        variances = weights.variances(&variances);
    }
    texels
}

/// The mean of red, green and blue.
fn mean_of(color: Vec3) -> f32 {
    color.element_sum() / 3.0
}

/// Weights of the neighbours of each texel, which add up to 1.
struct Weights {
    side: usize,
    step: usize,
    of_texels: Vec<[f32; NEIGHBOURS]>,
}

/// Neighbour `number` of texel `i`; beyond the border, the nearest one.
fn neighbour(i: usize, number: usize, side: usize, step: usize) -> usize {
    let reach = SPLINE.len() / 2 * step;
    let moved = |at: usize, by: usize| (at + by * step).saturating_sub(reach).min(side - 1);
    let [x, y] = [i % side, i / side];
    moved(y, number / SPLINE.len()) * side + moved(x, number % SPLINE.len())
}

impl Weights {
    /// Those of the spline times `factor(texel, neighbour)`.
    fn new(side: usize, step: usize, factor: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        let of_texel = |i| {
            let weights: [f32; NEIGHBOURS] = std::array::from_fn(|number| {
                let [row, column] = [number / SPLINE.len(), number % SPLINE.len()];
                SPLINE[row] * SPLINE[column] * factor(i, neighbour(i, number, side, step))
            });
            let sum: f32 = weights.iter().sum();
            weights.map(|weight| weight / sum)
        };
        Self { side, step, of_texels: (0..side * side).into_par_iter().map(of_texel).collect() }
    }

    /// The neighbours of texel `i` with their weights.
    fn of(&self, i: usize) -> impl Iterator<Item = (usize, f32)> {
        let weights = self.of_texels[i].iter().enumerate();
        weights.map(move |(number, weight)| (neighbour(i, number, self.side, self.step), *weight))
    }

    /// The variances of means, from those of independent texels.
    fn variances(&self, variances: &[f32]) -> Vec<f32> {
        let of = |i| self.of(i).map(|(at, weight)| weight * weight * variances[at]).sum();
        (0..variances.len()).map(of).collect()
    }
}

/// Weights that are 0 where texels differ by more than their noise.
fn similar_weights(texels: &[Vec3], variances: &[f32], side: usize, step: usize) -> Weights {
    let most = LARGEST_DIFFERENCE * LARGEST_DIFFERENCE;
    Weights::new(side, step, |first, second| {
        let square = mean_of(texels[first] - texels[second]).powi(2);
        let limit = most * (variances[first] + variances[second]);
        // Equal texels may have no noise
        if square <= 0.0 { 1.0 } else { (1.0 - square / limit).max(0.0).powi(2) }
    })
}

/// Means of neighbours.
fn averaged<T>(texels: &[T], weights: &Weights) -> Vec<T>
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::iter::Sum,
{
    let mean = |i| weights.of(i).map(|(at, weight)| texels[at] * weight).sum();
    (0..texels.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 32;

    /// A number from -1 to 1.
    fn noise(i: usize) -> f32 {
        let bits = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((bits ^ (bits >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / 8_388_608.0 - 1.0
    }

    /// A step of 1 in the middle with noise of each half up to `amplitude`, and its parts.
    fn noisy(amplitude: f32) -> (NoisyMap, [Vec<Vec3>; 2]) {
        let step = |i: usize| if i % SIDE < SIDE / 2 { 1.0 } else { 2.0 };
        let halves: Vec<[f32; 2]> = (0..SIDE * SIDE)
            .map(|i| [0, 1].map(|half| step(i) + amplitude * noise(2 * i + half)))
            .collect();
        let texels: Vec<Vec3> = halves.iter().map(|[a, b]| Vec3::splat(0.5 * (a + b))).collect();
        let differences = halves.iter().map(|[a, b]| Vec3::splat(a - b)).collect();
        let parts = [0.25, 0.75].map(|part| texels.iter().map(|texel| part * *texel).collect());
        (NoisyMap { texels, differences }, parts)
    }

    #[test]
    fn noise_is_removed_and_edges_stay() {
        let (map, mut parts) = noisy(0.2);
        let clean = remove_noise(map, &mut parts, SIDE);
        let error = |i: usize| clean[i].x - if i % SIDE < SIDE / 2 { 1.0 } else { 2.0 };
        let mean = (0..clean.len()).map(|i| error(i).powi(2)).sum::<f32>() / clean.len() as f32;
        // That of the noise is 0.2 / sqrt(6)
        assert!(mean.sqrt() < 0.055, "{}", mean.sqrt());
        // An average across the edge would be off by more than the noise
        assert!((0..clean.len()).all(|i| error(i).abs() < 0.2));
        // The parts still add up
        for i in 0..clean.len() {
            let sum = parts[0][i] + parts[1][i];
            assert!((sum - clean[i]).abs().max_element() < 1e-5, "{sum} {}", clean[i]);
        }
    }

    #[test]
    fn maps_without_noise_do_not_change() {
        let (map, mut parts) = noisy(0.0);
        let expected = map.texels.clone();
        let clean = remove_noise(map, &mut parts, SIDE);
        assert!(clean.iter().zip(&expected).all(|(a, b)| (*a - *b).abs().max_element() < 1e-5));
    }
}
