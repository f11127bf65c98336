//! Scales pictures in linear light, with a Lanczos filter of three lobes, first along rows and then along columns.

use super::Picture;
use crate::math::functions::sin_cos;
use crate::output::view::byte_from_linear;
use crate::scene::RgbEncoding;

/// Lobes of the filter on each side.
const LOBES: f32 = 3.0;

/// The weights of consecutive input pixels for one output pixel.
struct Taps {
    first: usize,
    weights: Vec<f32>,
}

impl Picture {
    /// The picture with another size. Averages light, not sRGB values, so that fine bright detail keeps its brightness.
    #[must_use]
    pub fn scaled(&self, width: usize, height: usize) -> Self {
        if [width, height] == self.size() {
            return self.clone();
        }
        // Scale rows in linear light
        let linear = linear_values();
        let taps = all_taps(self.width, width);
        let mut rows = vec![0.0_f32; 3 * width * self.height];
        for (y, row) in rows.chunks_mut(3 * width).enumerate() {
            let input = self.row(y).as_chunks::<3>().0;
            for (pixel, taps) in row.as_chunks_mut::<3>().0.iter_mut().zip(&taps) {
                for (weight, [r, g, b]) in taps.weights.iter().zip(&input[taps.first..]) {
                    pixel[0] += weight * linear[usize::from(*r)];
                    pixel[1] += weight * linear[usize::from(*g)];
                    pixel[2] += weight * linear[usize::from(*b)];
                }
            }
        }
        // Scale columns, and convert back
        let mut rgb = Vec::with_capacity(3 * width * height);
        let mut sums = vec![0.0_f32; 3 * width];
        for taps in all_taps(self.height, height) {
            sums.fill(0.0);
            let input = rows.chunks(3 * width).skip(taps.first);
            for (weight, row) in taps.weights.iter().zip(input) {
                for (sum, value) in sums.iter_mut().zip(row) {
                    *sum += weight * value;
                }
            }
            rgb.extend(sums.iter().map(|value| byte_from_linear(*value, 0.5)));
        }
        Self::new(width, height, rgb)
    }
}

/// Linear light of each 8-bit sRGB value.
fn linear_values() -> Vec<f32> {
    let color = |byte: u8| RgbEncoding::Srgb8.color([f64::from(byte); 3]).x;
    (0..=255).map(color).collect()
}

/// The taps of all `to` output pixels of a row of `from` pixels.
fn all_taps(from: usize, to: usize) -> Vec<Taps> {
    let ratio = from as f32 / to as f32;
    (0..to).map(|at| taps(at, ratio, from)).collect()
}

/// The taps of output pixel `at`. The filter widens with `ratio`, the input pixels per output pixel.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "indices of pixels, clamped to the row"
)]
fn taps(at: usize, ratio: f32, from: usize) -> Taps {
    let center = (at as f32 + 0.5) * ratio;
    let stretch = ratio.max(1.0);
    let reach = LOBES * stretch;
    let first = ((center - reach).floor().max(0.0) as usize).min(from - 1);
    let end = ((center + reach).ceil().max(1.0) as usize).clamp(first + 1, from);
    let weight = |i: usize| lanczos((i as f32 + 0.5 - center) / stretch);
    let mut weights: Vec<f32> = (first..end).map(weight).collect();
    let sum: f32 = weights.iter().sum();
    for weight in &mut weights {
        *weight /= sum;
    }
    Taps { first, weights }
}

/// The filter at distance `x` in output pixels.
fn lanczos(x: f32) -> f32 {
    let sinc = |x: f32| sin_cos(std::f32::consts::PI * x).0 / (std::f32::consts::PI * x);
    if x.abs() < 1e-4 {
        1.0
    } else if x.abs() < LOBES {
        sinc(x) * sinc(x / LOBES)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_colour_stays_the_same() {
        let picture = Picture::filled(37, 11, [200, 3, 118]);
        for [width, height] in [[5, 3], [1, 1], [37, 11], [60, 40]] {
            let expected = Picture::filled(width, height, [200, 3, 118]);
            assert_eq!(picture.scaled(width, height), expected);
        }
    }

    /// Black and white lines become the grey of half of the light, 188 in sRGB, not the mean of the bytes, 128.
    #[test]
    fn light_is_averaged() {
        let row = [[0; 3], [255; 3]].as_flattened().repeat(32);
        let lines = Picture::new(64, 8, row.repeat(8));
        let scaled = lines.scaled(8, 2);
        for pixel in &scaled.pixels()[2..6] {
            assert!(pixel.iter().all(|v| v.abs_diff(188) <= 1), "{pixel:?}");
        }
    }

    #[test]
    fn an_edge_stays_at_its_place() {
        let mut picture = Picture::filled(80, 80, [0; 3]);
        picture.put(&Picture::filled(40, 80, [255; 3]), 40, 0);
        let small = picture.scaled(8, 8);
        let row: Vec<u8> = small.row(4).iter().copied().step_by(3).collect();
        assert!(row[..3].iter().all(|v| *v < 40) && row[5..].iter().all(|v| *v > 215), "{row:?}");
        assert!(row[3] < 96 && row[4] > 224, "{row:?}");
    }
}
