//! Computes the samples of a brick from the field around it: smoothed where particles are crowded, sharp elsewhere.

use super::brick::{SAMPLES, VOXELS};
use super::layout::Layout;
use super::raw::{Codes, decode};

/// Samples computed at once.
const LANES: usize = 8;

/// Weights of a Gaussian at distances of 0, 1, ... voxels; the sum over both sides is 1.
pub(super) fn taps(layout: &Layout) -> Vec<f32> {
    let weight = |distance: i32| {
        let x = f64::from(distance) / f64::from(layout.sigma.max(f32::MIN_POSITIVE));
        libm::exp(-0.5 * x * x)
    };
    let total: f64 = (-layout.blur..=layout.blur).map(weight).sum();
    #[expect(clippy::cast_possible_truncation, reason = "the field is f32")]
    (0..=layout.blur).map(|d| (weight(d) / total) as f32).collect()
}

/// One part (smooth or sharp) of the field over a brick.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part<'a> {
    /// A uniform value.
    Uniform(f32),
    /// Samples at the first corner of each voxel.
    Codes(&'a Codes),
}

/// One part of the field over a brick and its 26 neighbours, by z, y and x.
pub(super) type Around<'a> = [Part<'a>; 27];

/// The samples of a brick, in rows of 16.
pub(super) type BrickField = [[[f32; 16]; SAMPLES]; SAMPLES];

/// Floats per row of the window: three bricks, and padding for groups that extend beyond them.
const STRIDE: usize = 32;
/// Index of the first sample of a brick along an axis of the window.
const FIRST: usize = VOXELS - 1;
/// Rows of the window along an axis.
const WINDOW_ROWS: usize = 3 * VOXELS;

/// Buffers for the samples of one brick.
#[derive(Debug)]
pub(super) struct Blur {
    /// The field over a brick and its neighbours.
    window: Vec<[f32; STRIDE]>,
    /// The window blurred along z.
    along_z: Vec<[f32; STRIDE]>,
    /// The window blurred along z and y.
    along_y: Vec<[f32; STRIDE]>,
}

impl Default for Blur {
    fn default() -> Self {
        Self {
            window: vec![[0.0; STRIDE]; WINDOW_ROWS * WINDOW_ROWS],
            along_z: vec![[0.0; STRIDE]; SAMPLES * WINDOW_ROWS],
            along_y: vec![[0.0; STRIDE]; SAMPLES * SAMPLES],
        }
    }
}

impl Blur {
    /// Writes the sharp part to `field`.
    #[inline(always)]
    pub(super) fn copy_sharp(&mut self, around: &Around, field: &mut BrickField) {
        if around.iter().all(|part| matches!(part, Part::Uniform(0.0))) {
            *field = [[[0.0; 16]; SAMPLES]; SAMPLES];
            return;
        }
        self.fill(around, 1);
        for (z, layer) in field.iter_mut().enumerate() {
            for (y, row) in layer.iter_mut().enumerate() {
                let from = &self.window[(FIRST + z) * WINDOW_ROWS + FIRST + y];
                row.copy_from_slice(&from[FIRST..FIRST + 16]);
            }
        }
    }

    /// Adds the smoothed part to `field`: a separable Gaussian blur.
    #[inline(always)]
    pub(super) fn add_smooth(&mut self, around: &Around, taps: &[f32], field: &mut BrickField) {
        // The compiler unrolls loops of constant length.
        match taps {
            [a, b] => self.add(around, &[*a, *b], field),
            [a, b, c] => self.add(around, &[*a, *b, *c], field),
            [a, b, c, d] => self.add(around, &[*a, *b, *c, *d], field),
            [a, b, c, d, e] => self.add(around, &[*a, *b, *c, *d, *e], field),
            [a, b, c, d, e, f] => self.add(around, &[*a, *b, *c, *d, *e, *f], field),
            [a, b, c, d, e, f, g, ..] => self.add(around, &[*a, *b, *c, *d, *e, *f, *g], field),
            [] | [_] => {}
        }
    }

    #[inline(always)]
    fn add<const TAPS: usize>(
        &mut self,
        around: &Around,
        taps: &[f32; TAPS],
        field: &mut BrickField,
    ) {
        // Gather the samples within reach of the blur
        let blur = TAPS - 1;
        self.fill(around, blur + 1);
        let rows = FIRST - blur..FIRST + SAMPLES + blur;
        // Blur along z
        for z in 0..SAMPLES {
            for y in rows.clone() {
                let row = |step: usize| &self.window[(FIRST + z + step - blur) * WINDOW_ROWS + y];
                self.along_z[z * WINDOW_ROWS + y] = weighted_rows(row, taps);
            }
        }
        // Blur along y
        for z in 0..SAMPLES {
            for y in 0..SAMPLES {
                let row = |step: usize| &self.along_z[z * WINDOW_ROWS + FIRST + y + step - blur];
                self.along_y[z * SAMPLES + y] = weighted_rows(row, taps);
            }
        }
        // Blur along x, and add the result
        for (z, layer) in field.iter_mut().enumerate() {
            for (y, row) in layer.iter_mut().enumerate() {
                let from = &self.along_y[z * SAMPLES + y];
                for (group, values) in row.chunks_exact_mut(LANES).enumerate() {
                    let first = FIRST + group * LANES;
                    let part = |step: usize| -> &[f32; LANES] {
                        let part = from[first + step - blur..].first_chunk();
                        part.expect("rows have room for groups")
                    };
                    let sums = weighted(part, taps);
                    for (value, sum) in values.iter_mut().zip(sums) {
                        *value += sum;
                    }
                }
            }
        }
    }

    /// Copies the samples of a brick, and `margin` voxels of its neighbours, to the window.
    #[inline(always)]
    fn fill(&mut self, around: &Around, margin: usize) {
        // A brick needs one sample more than it has voxels, the first sample of the next brick
        let range = VOXELS - margin..2 * VOXELS + 1 + margin;
        for z in range.clone() {
            for y in range.clone() {
                // Copy or decode the row in each of the three bricks along x
                let bricks = &around[9 * (z / VOXELS) + 3 * (y / VOXELS)..][..3];
                let from = (z % VOXELS * VOXELS + y % VOXELS) * VOXELS;
                let row = &mut self.window[z * WINDOW_ROWS + y];
                for (to, brick) in row.chunks_exact_mut(VOXELS).zip(bricks) {
                    match brick {
                        Part::Uniform(value) => to.fill(*value),
                        Part::Codes(codes) => {
                            for (to, code) in to.iter_mut().zip(&codes[from..from + VOXELS]) {
                                *to = decode(*code);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The weighted sum of rows; `row` returns them from the farthest on one side to the farthest on the other.
#[inline(always)]
fn weighted_rows<'a, const TAPS: usize>(
    row: impl Fn(usize) -> &'a [f32; STRIDE],
    taps: &[f32; TAPS],
) -> [f32; STRIDE] {
    let mut sums = [0.0; STRIDE];
    for group in (0..WINDOW_ROWS).step_by(LANES) {
        let part = |step: usize| -> &[f32; LANES] {
            let part = row(step)[group..].first_chunk();
            part.expect("rows have whole groups")
        };
        sums[group..group + LANES].copy_from_slice(&weighted(part, taps));
    }
    sums
}

/// The weighted sum of groups of values; `group` returns them in the same order.
#[inline(always)]
fn weighted<'a, const TAPS: usize>(
    group: impl Fn(usize) -> &'a [f32; LANES],
    taps: &[f32; TAPS],
) -> [f32; LANES] {
    let blur = TAPS - 1;
    let mut sums = group(blur).map(|value| taps[0] * value);
    for (distance, tap) in taps.iter().enumerate().skip(1) {
        let (before, after) = (group(blur - distance), group(blur + distance));
        for lane in 0..LANES {
            sums[lane] += tap * (before[lane] + after[lane]);
        }
    }
    sums
}
