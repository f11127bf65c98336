//! The samples of one brick out of the field around it: smoothed where particles are in company, sharp
//! elsewhere.

use super::brick::{SAMPLES, VOXELS};
use super::layout::Layout;
use super::raw::{Codes, decode};

/// Samples computed at once.
const LANES: usize = 8;

/// Weights of a Gaussian at distances of 0, 1, ... voxels; together 1.
pub(super) fn taps(layout: &Layout) -> Vec<f32> {
    let weight = |distance: i32| {
        let x = f64::from(distance) / f64::from(layout.sigma.max(f32::MIN_POSITIVE));
        (-0.5 * x * x).exp()
    };
    let total: f64 = (-layout.blur..=layout.blur).map(weight).sum();
    #[expect(clippy::cast_possible_truncation, reason = "the field is f32")]
    (0..=layout.blur)
        .map(|d| (weight(d) / total) as f32)
        .collect()
}

/// What is known of a part of the field over a brick.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part<'a> {
    /// Everywhere this.
    Even(f32),
    /// At each voxel's first corner.
    Codes(&'a Codes),
}

/// A part of the field over a brick and its 26 neighbours, by z, y and x.
pub(super) type Around<'a> = [Part<'a>; 27];

/// The field at the samples of a brick, in rows of 16.
pub(super) type BrickField = [[[f32; 16]; SAMPLES]; SAMPLES];

/// The memory of putting bricks together.
#[derive(Debug, Default)]
pub(super) struct Blur {
    /// The field around a brick.
    window: Vec<f32>,
    /// Blurred along z, and along z and y.
    along_z: Vec<f32>,
    along_y: Vec<f32>,
}

impl Blur {
    /// The sharp part.
    #[inline(always)]
    pub(super) fn copy_sharp(&mut self, around: &Around, field: &mut BrickField) {
        let stride = self.fill(around, 1, SAMPLES);
        for (z, layer) in field.iter_mut().enumerate() {
            for (y, row) in layer.iter_mut().enumerate() {
                let start = (z * SAMPLES + y) * stride;
                row.copy_from_slice(&self.window[start..start + 16]);
            }
        }
    }

    /// Adds the smoothed part: a Gaussian blur, one axis after the other. There are two taps at least.
    #[inline(always)]
    pub(super) fn add_smooth(&mut self, around: &Around, taps: &[f32], field: &mut BrickField) {
        let blur = taps.len() - 1;
        let wide = SAMPLES + 2 * blur;
        let stride = self.fill(around, blur + 1, wide);
        let groups = wide.div_ceil(LANES);
        self.along_z.resize(SAMPLES * wide * stride, 0.0);
        self.along_y.resize(SAMPLES * SAMPLES * stride, 0.0);
        let layer = wide * stride;
        for z in 0..SAMPLES {
            for y in 0..wide {
                let row = z * layer + y * stride;
                for group in (0..groups * LANES).step_by(LANES) {
                    let sums = weighted(&self.window, row + blur * layer + group, layer, taps);
                    self.along_z[row + group..row + group + LANES].copy_from_slice(&sums);
                }
            }
        }
        for z in 0..SAMPLES {
            for y in 0..SAMPLES {
                let from = z * layer + (y + blur) * stride;
                let to = (z * SAMPLES + y) * stride;
                for group in (0..groups * LANES).step_by(LANES) {
                    let sums = weighted(&self.along_z, from + group, stride, taps);
                    self.along_y[to + group..to + group + LANES].copy_from_slice(&sums);
                }
            }
        }
        for (z, layer) in field.iter_mut().enumerate() {
            for (y, row) in layer.iter_mut().enumerate() {
                let from = (z * SAMPLES + y) * stride + blur;
                for (group, values) in row.chunks_exact_mut(LANES).enumerate() {
                    let sums = weighted(&self.along_y, from + group * LANES, 1, taps);
                    for (value, sum) in values.iter_mut().zip(sums) {
                        *value += sum;
                    }
                }
            }
        }
    }

    /// Brings `wide` samples along each axis into the window, the first `margin` before the brick. Returns the
    /// floats from row to row, with room for groups that reach beyond its end.
    #[inline(always)]
    fn fill(&mut self, around: &Around, margin: usize, wide: usize) -> usize {
        let stride = wide.next_multiple_of(LANES) + 2 * LANES;
        self.window.resize(stride * wide * wide, 0.0);
        for z in 0..wide {
            let (brick_z, part_z) = place(z, margin);
            for y in 0..wide {
                let (brick_y, part_y) = place(y, margin);
                let row = (z * wide + y) * stride;
                let row = &mut self.window[row..row + wide];
                let bricks = &around[9 * brick_z + 3 * brick_y..][..3];
                let from = (part_z * VOXELS + part_y) * VOXELS;
                let (before, rest) = row.split_at_mut(margin);
                let (middle, after) = rest.split_at_mut(VOXELS);
                copy(before, bricks[0], from + VOXELS - margin);
                copy(middle, bricks[1], from);
                copy(after, bricks[2], from);
            }
        }
        stride
    }
}

/// The brick (0 to 2) that sample `at` of a window lies in, and its place there.
#[inline(always)]
fn place(at: usize, margin: usize) -> (usize, usize) {
    let from_first = at + VOXELS - margin;
    (from_first / VOXELS, from_first % VOXELS)
}

#[inline(always)]
fn copy(to: &mut [f32], part: Part, from: usize) {
    match part {
        Part::Even(value) => to.fill(value),
        Part::Codes(codes) => {
            for (to, code) in to.iter_mut().zip(&codes[from..]) {
                *to = decode(*code);
            }
        }
    }
}

/// The sum of groups of values at distances of `step` on both sides of `at`, each by its weight.
#[inline(always)]
fn weighted(values: &[f32], at: usize, step: usize, taps: &[f32]) -> [f32; LANES] {
    let group = |at: usize| -> [f32; LANES] {
        let group = values.get(at..).and_then(|rest| rest.first_chunk());
        *group.expect("windows have room beside the brick")
    };
    let mut sums = group(at).map(|value| taps[0] * value);
    for (distance, tap) in taps.iter().enumerate().skip(1) {
        let (before, after) = (group(at - distance * step), group(at + distance * step));
        for lane in 0..LANES {
            sums[lane] += tap * (before[lane] + after[lane]);
        }
    }
    sums
}
