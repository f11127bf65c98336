//! The inner loops over pairs of pixels, compiled for each instruction set.

use super::planes::{
    ALBEDO, COVERAGE, COVERAGE_SUMS, DEPTH, EVEN, Halves, NOISE, NORMAL, ODD, Pixels, SLOPE_X,
    SLOPE_Y, STRIDE, Sums, WEIGHTS, window, window_len, window_mut,
};
use super::settings::{DEPTH_TOLERANCE, OWN_PART, PATCH_SIDE};
use spherule_tree::math::{LANES, Lanes, lane_kernel, larger, smaller};

/// Upper bound of the squared difference of two pixels relative to their noise, so that a single pixel of a patch,
/// infinite values included, counts like a strong edge. A patch in which all others agree is then still rejected.
pub(super) const MAX_DISTANCE: f32 = 64.0;

/// A window of the colour distances in the rows of a patch.
type PatchRows = [f32; window_len(2 * PATCH_SIDE)];

/// `(1 - x/8)^8`, which approximates `exp(-x)` and is 0 from 8 on. Only products are needed. NaN gives 0.
#[inline(always)]
fn weight_of(x: f32) -> f32 {
    let base = larger(1.0 - x * 0.125, 0.0);
    let square = base * base;
    let fourth = square * square;
    fourth * fourth
}

/// The squared distance of the vectors of `p` and `q` that begin at `plane`, in `lane`.
#[inline(always)]
fn squared_distance(p: &Pixels, q: &Pixels, plane: usize, lane: usize) -> f32 {
    let at = plane * STRIDE + lane;
    let x = p[at] - q[at];
    let y = p[at + STRIDE] - q[at + STRIDE];
    let z = p[at + 2 * STRIDE] - q[at + 2 * STRIDE];
    x * x + y * y + z * z
}

/// Compares the colours of `count` pixels `p` with `q` in both halves, relative to their noise: two planes, `pixels`.
/// Their sums over the neighbours along the row of a patch go to the first `sum_count` pixels of the two planes `sums`.
#[inline(always)]
fn distances_body(
    p: &[f32],
    q: &[f32],
    count: usize,
    sum_count: usize,
    pixels: &mut [f32],
    sums: &mut [f32],
) {
    // Compare pixels
    for x in (0..count).step_by(LANES) {
        let (p, q): (&Pixels, &Pixels) = (window(p, x), window(q, x));
        let pixels: &mut Halves = window_mut(pixels, x);
        for l in 0..LANES {
            let noise = [p[NOISE * STRIDE + l], q[NOISE * STRIDE + l]];
            let scale = 1.0 / (noise[0] + noise[1]);
            let expected = 2.0 * smaller(noise[0], noise[1]);
            let even = squared_distance(p, q, EVEN, l);
            let odd = squared_distance(p, q, ODD, l);
            pixels[l] = smaller((even - expected) * scale, MAX_DISTANCE);
            pixels[STRIDE + l] = smaller((odd - expected) * scale, MAX_DISTANCE);
        }
    }
    // Sum over neighbours
    for half in [0, STRIDE] {
        for x in (half..half + sum_count).step_by(LANES) {
            let pixels: &[f32; LANES + PATCH_SIDE - 1] = window(pixels, x);
            let sums: &mut Lanes = window_mut(sums, x);
            for l in 0..LANES {
                sums[l] = pixels[l] + pixels[l + 1] + pixels[l + 2];
            }
        }
    }
}

lane_kernel! {
    pub(super) fn distances(
        p: &[f32], q: &[f32], count: usize, sum_count: usize, pixels: &mut [f32], sums: &mut [f32],
    ) = distances_body;
}

/// Where the second pixel of pairs is, and how colours are compared.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairScale {
    /// Factor of the sum of colour distances over a patch.
    pub(super) color: f32,
    /// Columns from one pixel to the other, not negative.
    pub(super) columns: f32,
    /// Rows from one pixel to the other, not negative.
    pub(super) rows: f32,
}

/// The tolerance of depth at a pixel.
#[inline(always)]
fn tolerance(pixel: &Pixels, scale: &PairScale, lane: usize) -> f32 {
    pixel[SLOPE_X * STRIDE + lane] * scale.columns
        + pixel[SLOPE_Y * STRIDE + lane] * scale.rows
        + pixel[DEPTH * STRIDE + lane] * DEPTH_TOLERANCE
}

/// Computes the weights of `count` pairs of pixels `p`, `q`, and moves their colours towards each other: adds the
/// weighted differences and the weights to the sums of both pixels. The even half has the weights of the odd one, and
/// conversely. With `COVERAGES`, coverage is averaged, too. `distances` has the colour distances along the rows of the
/// patch: two planes for each.
#[inline(always)]
fn pairs_of<const COVERAGES: bool>(
    p: &[f32],
    q: &[f32],
    count: usize,
    scale: &PairScale,
    distances: &[f32],
    p_sums: &mut [f32],
    q_sums: &mut [f32],
) {
    let scale = *scale;
    for x in (0..count).step_by(LANES) {
        let (p, q): (&Pixels, &Pixels) = (window(p, x), window(q, x));
        let distances: &PatchRows = window(distances, x);
        let p_sums: &mut Sums = window_mut(p_sums, x);
        let q_sums: &mut Sums = window_mut(q_sums, x);
        let mut weights = [[0.0; LANES]; 2];
        for l in 0..LANES {
            // Compare features
            let albedo = squared_distance(p, q, ALBEDO, l);
            let normal = squared_distance(p, q, NORMAL, l);
            let tolerance = smaller(tolerance(p, &scale, l), tolerance(q, &scale, l));
            let z = (p[DEPTH * STRIDE + l] - q[DEPTH * STRIDE + l]) / tolerance;
            let feature = larger(larger(albedo, normal), z * z);
            // Sum the colour distances over the patch
            let (mut even, mut odd) = (distances[l], distances[STRIDE + l]);
            for row in 1..PATCH_SIDE {
                even += distances[2 * row * STRIDE + l];
                odd += distances[(2 * row + 1) * STRIDE + l];
            }
            let (even, odd) = (even * scale.color, odd * scale.color);
            weights[0][l] = weight_of(larger(larger(odd, even * OWN_PART), feature));
            weights[1][l] = weight_of(larger(larger(even, odd * OWN_PART), feature));
        }
        // Accumulate
        for (half, weights) in weights.iter().enumerate() {
            let first = if half == 0 { EVEN } else { ODD };
            for plane in first..first + 3 {
                move_together(p, q, [plane, plane], weights, p_sums, q_sums);
            }
            if COVERAGES {
                let planes = [COVERAGE + half, COVERAGE_SUMS + half];
                move_together(p, q, planes, weights, p_sums, q_sums);
            }
            let at = (WEIGHTS + half) * STRIDE;
            for l in 0..LANES {
                p_sums[at + l] += weights[l];
                q_sums[at + l] += weights[l];
            }
        }
    }
}

#[inline(always)]
fn pairs_body(
    p: &[f32],
    q: &[f32],
    count: usize,
    scale: &PairScale,
    distances: &[f32],
    p_sums: &mut [f32],
    q_sums: &mut [f32],
) {
    pairs_of::<false>(p, q, count, scale, distances, p_sums, q_sums);
}

#[inline(always)]
fn covered_pairs_body(
    p: &[f32],
    q: &[f32],
    count: usize,
    scale: &PairScale,
    distances: &[f32],
    p_sums: &mut [f32],
    q_sums: &mut [f32],
) {
    pairs_of::<true>(p, q, count, scale, distances, p_sums, q_sums);
}

/// Adds the weighted difference of `p` and `q` in `plane` to the plane `sum` of the sums of `p`, and subtracts it from
/// that of `q`.
#[inline(always)]
fn move_together(
    p: &Pixels,
    q: &Pixels,
    [plane, sum]: [usize; 2],
    weights: &Lanes,
    p_sums: &mut Sums,
    q_sums: &mut Sums,
) {
    let (at, to) = (plane * STRIDE, sum * STRIDE);
    for l in 0..LANES {
        let moved = weights[l] * (q[at + l] - p[at + l]);
        p_sums[to + l] += moved;
        q_sums[to + l] -= moved;
    }
}

lane_kernel! {
    pub(super) fn pairs(
        p: &[f32], q: &[f32], count: usize, scale: &PairScale, distances: &[f32], p_sums: &mut [f32],
        q_sums: &mut [f32],
    ) = pairs_body;
}

lane_kernel! {
    /// [`pairs`] for pictures with a transparent background.
    pub(super) fn covered_pairs(
        p: &[f32], q: &[f32], count: usize, scale: &PairScale, distances: &[f32], p_sums: &mut [f32],
        q_sums: &mut [f32],
    ) = covered_pairs_body;
}
