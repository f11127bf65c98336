//! One palette for all pictures of a GIF, and dithering with it.
//!
//! The palette starts with the median cut by variance of Wu ("Color quantization by dynamic programming and principal
//! analysis", 1992; here along the axes) and is refined by k-means. A pixel becomes one of two colours of the palette
//! whose mixture is nearest to it (Yliluoma's ordered dithering), by a fixed pattern: what does not change between
//! two pictures has the same bytes in both, so that nothing flickers and files are small.

use std::collections::{BTreeMap, HashMap};

use crate::output::view::dither_threshold;
use crate::picture::Picture;

/// Most colours. One more index means "as before".
pub(super) const MAX_COLORS: usize = 255;

/// Bits of each component in the histogram.
const BITS: u32 = 6;

/// Most colours that are counted by themselves.
const MAX_EXACT: usize = 4096;

/// Rounds of k-means.
const ROUNDS: usize = 4;

/// Weights of red, green and blue in distances; eyes see differences of green best.
const WEIGHTS: [f32; 3] = [0.75, 1.0, 0.5];

/// Weight of the distance of two colours that are mixed. Small values match the mean best, and large ones give the
/// least noise.
const MIX_WEIGHT: f32 = 0.12;

/// Numbers of pixels by colour.
pub(super) struct Histogram {
    cells: Vec<Cell>,
    /// Each colour by itself, if there are few.
    exact: Option<BTreeMap<[u8; 3], u64>>,
}

/// The pixels of similar colours.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    count: u64,
    sums: [u64; 3],
}

/// A mean colour, with its number of pixels.
#[derive(Debug, Clone, Copy)]
struct Sample {
    color: [f32; 3],
    weight: f64,
}

impl Histogram {
    pub(super) fn new() -> Self {
        Self { cells: vec![Cell::default(); 1 << (3 * BITS)], exact: Some(BTreeMap::new()) }
    }

    /// Counts the pixels of `picture`.
    pub(super) fn add(&mut self, picture: &Picture) {
        for pixel in picture.pixels() {
            let index =
                pixel.iter().fold(0, |index, v| (index << BITS) | usize::from(v >> (8 - BITS)));
            let cell = &mut self.cells[index];
            cell.count += 1;
            for (sum, value) in cell.sums.iter_mut().zip(pixel) {
                *sum += u64::from(*value);
            }
            if let Some(exact) = &mut self.exact {
                *exact.entry(*pixel).or_default() += 1;
                if exact.len() > MAX_EXACT {
                    self.exact = None;
                }
            }
        }
    }

    /// The palette of these pixels.
    pub(super) fn palette(&self) -> Palette {
        let mut samples = self.samples();
        let mut colors = cut(&mut samples);
        for _ in 0..ROUNDS {
            refine(&mut colors, &samples);
        }
        Palette::new(&colors)
    }

    fn samples(&self) -> Vec<Sample> {
        if let Some(exact) = &self.exact {
            let colors = exact.iter();
            let sample = |(color, count): (&[u8; 3], &u64)| Sample {
                color: color.map(f32::from),
                weight: *count as f64,
            };
            return colors.map(sample).collect();
        }
        let cells = self.cells.iter().filter(|cell| cell.count > 0);
        #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
        let sample = |cell: &Cell| Sample {
            color: cell.sums.map(|sum| (sum as f64 / cell.count as f64) as f32),
            weight: cell.count as f64,
        };
        cells.map(sample).collect()
    }
}

/// A range of samples, and the sum of their squared distances from the mean along the best axis for a cut.
struct Group {
    start: usize,
    end: usize,
    axis: usize,
    spread: f64,
}

impl Group {
    fn new(samples: &[Sample], start: usize, end: usize) -> Self {
        let part = &samples[start..end];
        let spreads = [0, 1, 2].map(|axis| spread(part, axis));
        let axis = (0..3).max_by(|a, b| spreads[*a].total_cmp(&spreads[*b])).unwrap_or(0);
        Self { start, end, axis, spread: spreads[axis] }
    }
}

/// The weighted sum of squared distances from the mean along `axis`.
fn spread(samples: &[Sample], axis: usize) -> f64 {
    let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for sample in samples {
        let value = f64::from(sample.color[axis]);
        weight += sample.weight;
        sum += sample.weight * value;
        squares += sample.weight * value * value;
    }
    f64::from(WEIGHTS[axis]) * (squares - sum * sum / weight).max(0.0)
}

/// Divides the samples into groups, the one with the largest spread first, and returns the means.
fn cut(samples: &mut [Sample]) -> Vec<[f32; 3]> {
    if samples.is_empty() {
        return vec![[0.0; 3]];
    }
    let mut groups = vec![Group::new(samples, 0, samples.len())];
    while groups.len() < MAX_COLORS {
        let widest =
            (0..groups.len()).max_by(|a, b| groups[*a].spread.total_cmp(&groups[*b].spread));
        let Some(widest) = widest.filter(|i| groups[*i].spread > 0.0) else {
            break;
        };
        let Group { start, end, axis, .. } = groups[widest];
        let part = &mut samples[start..end];
        part.sort_by(|a, b| a.color[axis].total_cmp(&b.color[axis]));
        let at = start + best_cut(part, axis);
        groups[widest] = Group::new(samples, start, at);
        groups.push(Group::new(samples, at, end));
    }
    groups.iter().map(|group| mean(&samples[group.start..group.end])).collect()
}

/// The index before which to cut sorted samples, so that the parts have the smallest spread.
fn best_cut(samples: &[Sample], axis: usize) -> usize {
    let value = |sample: &Sample| sample.weight * f64::from(sample.color[axis]);
    let weight: f64 = samples.iter().map(|sample| sample.weight).sum();
    let sum: f64 = samples.iter().map(value).sum();
    let (mut left_weight, mut left_sum) = (0.0, 0.0);
    let (mut best, mut best_at) = (f64::NEG_INFINITY, 1);
    for (i, sample) in samples[..samples.len() - 1].iter().enumerate() {
        left_weight += sample.weight;
        left_sum += value(sample);
        // The smallest spread of the parts is the largest sum of these
        let right_sum = sum - left_sum;
        let between =
            left_sum * left_sum / left_weight + right_sum * right_sum / (weight - left_weight);
        if between > best {
            (best, best_at) = (between, i + 1);
        }
    }
    best_at
}

#[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
fn mean(samples: &[Sample]) -> [f32; 3] {
    let weight: f64 = samples.iter().map(|sample| sample.weight).sum();
    [0, 1, 2].map(|axis| {
        let sum: f64 = samples.iter().map(|s| s.weight * f64::from(s.color[axis])).sum();
        (sum / weight) as f32
    })
}

/// One round of k-means.
fn refine(colors: &mut [[f32; 3]], samples: &[Sample]) {
    let mut sums = vec![([0.0_f64; 3], 0.0_f64); colors.len()];
    for sample in samples {
        let (sum, weight) = &mut sums[nearest(colors, sample.color)];
        *weight += sample.weight;
        for (sum, value) in sum.iter_mut().zip(sample.color) {
            *sum += sample.weight * f64::from(value);
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
    for (color, (sum, weight)) in colors.iter_mut().zip(sums) {
        if weight > 0.0 {
            *color = sum.map(|sum| (sum / weight) as f32);
        }
    }
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| WEIGHTS[i] * (a[i] - b[i]) * (a[i] - b[i])).sum()
}

fn nearest(colors: &[[f32; 3]], color: [f32; 3]) -> usize {
    let mut best = (f32::INFINITY, 0);
    for (i, other) in colors.iter().enumerate() {
        let distance = distance(*other, color);
        if distance < best.0 {
            best = (distance, i);
        }
    }
    best.1
}

/// Up to [`MAX_COLORS`] colours.
pub(super) struct Palette {
    colors: Vec<[f32; 3]>,
    bytes: Vec<u8>,
}

/// Two indices, and the part of pixels that get the second.
#[derive(Debug, Clone, Copy)]
struct Mixture {
    first: u8,
    second: u8,
    part: f32,
}

impl Palette {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "means of bytes")]
    fn new(colors: &[[f32; 3]]) -> Self {
        let mut rounded: Vec<[u8; 3]> = colors.iter().map(|c| c.map(|v| v.round() as u8)).collect();
        rounded.sort_unstable();
        rounded.dedup();
        Self {
            colors: rounded.iter().map(|color| color.map(f32::from)).collect(),
            bytes: rounded.into_flattened(),
        }
    }

    /// The colours, three bytes each.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The mixture of two colours for `color`.
    #[expect(clippy::cast_possible_truncation, reason = "fewer than 256 colours")]
    fn mixture(&self, color: [u8; 3]) -> Mixture {
        let color = color.map(f32::from);
        let first = nearest(&self.colors, color);
        let base = self.colors[first];
        let mut best = Mixture { first: first as u8, second: first as u8, part: 0.0 };
        let mut smallest = distance(base, color);
        for (second, other) in self.colors.iter().enumerate() {
            let length = distance(base, *other);
            if length == 0.0 {
                continue;
            }
            // Project the colour to the line between both
            let along: f32 =
                (0..3).map(|i| WEIGHTS[i] * (color[i] - base[i]) * (other[i] - base[i])).sum();
            let part = (along / length).clamp(0.0, 0.5);
            let mixed = [0, 1, 2].map(|i| base[i] + part * (other[i] - base[i]));
            let error = distance(mixed, color) + MIX_WEIGHT * part * (1.0 - part) * length;
            if error < smallest {
                smallest = error;
                best = Mixture { second: second as u8, part, ..best };
            }
        }
        best
    }
}

/// Converts pictures to indices, with a memory of the colours that have occurred.
pub(super) struct Ditherer<'a> {
    palette: &'a Palette,
    mixtures: HashMap<[u8; 3], Mixture>,
}

/// Most colours that are remembered, about 50 MB.
const MAX_REMEMBERED: usize = 1 << 21;

impl<'a> Ditherer<'a> {
    pub(super) fn new(palette: &'a Palette) -> Self {
        Self { palette, mixtures: HashMap::new() }
    }

    /// The indices of the pixels.
    pub(super) fn indices(&mut self, picture: &Picture) -> Vec<u8> {
        if self.mixtures.len() > MAX_REMEMBERED {
            self.mixtures.clear();
        }
        let mut indices = Vec::with_capacity(picture.pixels().len());
        for (y, row) in (0_u32..).zip(picture.pixels().chunks(picture.width())) {
            for (x, pixel) in (0_u32..).zip(row) {
                let known = self.mixtures.entry(*pixel);
                let mixture = known.or_insert_with(|| self.palette.mixture(*pixel));
                let is_second = dither_threshold(x, y) < mixture.part;
                indices.push(if is_second { mixture.second } else { mixture.first });
            }
        }
        indices
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dithered(picture: &Picture) -> (Vec<u8>, Palette) {
        let mut histogram = Histogram::new();
        histogram.add(picture);
        let palette = histogram.palette();
        let indices = Ditherer::new(&palette).indices(picture);
        let color = |i: &u8| &palette.bytes[3 * usize::from(*i)..][..3];
        (indices.iter().flat_map(color).copied().collect(), palette)
    }

    #[test]
    fn few_colours_stay_exact() {
        let mut picture = Picture::filled(16, 16, [255; 3]);
        picture.put(&Picture::filled(5, 5, [200, 30, 10]), 3, 4);
        picture.put(&Picture::filled(1, 1, [10, 20, 200]), 15, 15);
        let (rgb, palette) = dithered(&picture);
        assert_eq!(rgb, picture.rgb());
        assert_eq!(palette.bytes().len(), 9);
    }

    /// More colours than the palette has: small areas keep their mean.
    #[test]
    fn gradients_keep_their_mean() {
        let color = |x: usize, y: usize| [x, y, (x + y) / 2].map(|v| u8::try_from(v).unwrap());
        let pixels = (0..256).flat_map(|y| (0..256).flat_map(move |x| color(x, y)));
        let picture = Picture::new(256, 256, pixels.collect());
        let (rgb, palette) = dithered(&picture);
        assert!(palette.bytes().len() > 3 * 200);
        let found = Picture::new(256, 256, rgb);
        let mut worst = 0_i64;
        for (left, top) in (0..16).flat_map(|y| (0..16).map(move |x| (16 * x, 16 * y))) {
            for axis in 0..3 {
                let sum = |picture: &Picture| -> i64 {
                    let rows = (top..top + 16).map(|y| &picture.row(y)[3 * left..3 * (left + 16)]);
                    rows.flat_map(|row| row.iter().skip(axis).step_by(3))
                        .map(|v| i64::from(*v))
                        .sum()
                };
                worst = worst.max((sum(&found) - sum(&picture)).abs());
            }
        }
        // A few values of 255, where the palette's colours are 20 apart
        assert!(worst < 4 * 256, "{worst}");
    }

    #[test]
    fn nothing_depends_on_the_order_of_pictures() {
        let pictures = [[1, 2, 3], [200, 100, 0]].map(|color| Picture::filled(3, 3, color));
        let palette = |order: [usize; 2]| {
            let mut histogram = Histogram::new();
            for i in order {
                histogram.add(&pictures[i]);
            }
            histogram.palette().bytes
        };
        assert_eq!(palette([0, 1]), palette([1, 0]));
    }
}
