//! The inner loops over pairs of pixels, compiled for each instruction set.
//!
//! Rows store their planes one after another, [`STRIDE`] values each (see [`super::tile`]). A [`window`] has all
//! planes at 16 consecutive pixels: one check of bounds, then constant distances.

use super::tile::{ALBEDO, DEPTH, EVEN, NOISE, NORMAL, ODD, SLOPE_X, SLOPE_Y, STRIDE};
use crate::math::{LANES, lane_kernel, larger, smaller};

/// Upper bound of the squared difference of two pixels relative to their noise, so that a single pixel of a patch,
/// infinite values included, counts like a strong edge. A patch in which all others agree is then still rejected.
pub(super) const MAX_DISTANCE: f32 = 64.0;

/// Values of [`window`] of a row with `planes` planes.
const fn window_len(planes: usize) -> usize {
    (planes - 1) * STRIDE + LANES
}

/// A window of the planes that describe pixels.
type Pixels = [f32; window_len(SLOPE_Y + 1)];

/// Planes of a row of sums: three components of weighted differences for each half, then the weights of each half.
pub(super) const SUMS: usize = 8;
/// The first plane with weights.
pub(super) const WEIGHTS: usize = 6;

/// A window of the planes of sums.
type Sums = [f32; window_len(SUMS)];

/// The values from `x` on.
#[inline(always)]
fn window<const N: usize>(row: &[f32], x: usize) -> &[f32; N] {
    let window = row[x..].first_chunk();
    window.expect("rows are long enough")
}

/// The values from `x` on.
#[inline(always)]
fn window_mut<const N: usize>(row: &mut [f32], x: usize) -> &mut [f32; N] {
    let window = row[x..].first_chunk_mut();
    window.expect("rows are long enough")
}

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

/// Compares the colours of `count` pixels `p` with `q` in both halves, relative to their noise. `sums` has a plane for
/// each half, with the sums of the results over `N` neighbours along the row for `sum_count` pixels. The buffers hold
/// the results.
#[inline(always)]
fn distances_body<const N: usize>(
    p: &[f32],
    q: &[f32],
    count: usize,
    sum_count: usize,
    even: &mut [f32],
    odd: &mut [f32],
    sums: &mut [f32],
) {
    // Compare pixels
    for x in (0..count).step_by(LANES) {
        let (p, q): (&Pixels, &Pixels) = (window(p, x), window(q, x));
        let even: &mut [f32; LANES] = window_mut(even, x);
        let odd: &mut [f32; LANES] = window_mut(odd, x);
        for l in 0..LANES {
            let noise = [p[NOISE * STRIDE + l], q[NOISE * STRIDE + l]];
            let scale = 1.0 / (noise[0] + noise[1]);
            let expected = 2.0 * smaller(noise[0], noise[1]);
            let [by_even, by_odd] = [squared_distance(p, q, EVEN, l), squared_distance(p, q, ODD, l)];
            even[l] = smaller((by_even - expected) * scale, MAX_DISTANCE);
            odd[l] = smaller((by_odd - expected) * scale, MAX_DISTANCE);
        }
    }
    // Sum over neighbours
    let (even_sums, odd_sums) = sums.split_at_mut(STRIDE);
    for x in (0..sum_count).step_by(LANES) {
        sum_neighbours::<N>(&even[x..], window_mut(even_sums, x));
    }
    for x in (0..sum_count).step_by(LANES) {
        sum_neighbours::<N>(&odd[x..], window_mut(odd_sums, x));
    }
}

#[inline(always)]
fn sum_neighbours<const N: usize>(values: &[f32], sums: &mut [f32; LANES]) {
    let values: &[f32; LANES + 4] = window(values, 0);
    for l in 0..LANES {
        let mut sum = values[l];
        for i in 1..N {
            sum += values[l + i];
        }
        sums[l] = sum;
    }
}

lane_kernel! {
    pub(super) fn distances_3(
        p: &[f32], q: &[f32], count: usize, sum_count: usize, even: &mut [f32], odd: &mut [f32], sums: &mut [f32],
    ) = distances_body::<3>;
}
lane_kernel! {
    pub(super) fn distances_5(
        p: &[f32], q: &[f32], count: usize, sum_count: usize, even: &mut [f32], odd: &mut [f32], sums: &mut [f32],
    ) = distances_body::<5>;
}

/// What turns distances into weights.
#[derive(Debug, Clone, Copy)]
pub(super) struct WeightScale {
    /// Factor of the sum of colour distances over a patch.
    pub(super) color: f32,
    /// Part of the distance in the half itself that counts, beside that of the other half.
    pub(super) own: f32,
    /// Distance of the pixels in columns and rows, not negative.
    pub(super) offset: [f32; 2],
    /// Tolerance of depth that is always allowed, relative to the depth.
    pub(super) depth: f32,
}

/// The difference of depth that the slopes of a pixel explain.
#[inline(always)]
fn tolerance(pixel: &Pixels, scale: &WeightScale, lane: usize) -> f32 {
    let [columns, rows] = scale.offset;
    pixel[SLOPE_X * STRIDE + lane] * columns
        + pixel[SLOPE_Y * STRIDE + lane] * rows
        + pixel[DEPTH * STRIDE + lane] * scale.depth
}

/// Computes the weights of `count` pairs of pixels `p`, `q`, and moves their colours towards each other: adds the
/// weighted differences and the weights to the sums of both pixels. The even half has the weights of the odd one, and
/// conversely. `distances` has the colour distances along the `N` rows of the patch: two planes for each.
#[inline(always)]
fn pairs_body<const N: usize, const D: usize>(
    p: &[f32],
    q: &[f32],
    count: usize,
    scale: &WeightScale,
    distances: &[f32],
    p_sums: &mut [f32],
    q_sums: &mut [f32],
) {
    let WeightScale { color, own, .. } = *scale;
    for x in (0..count).step_by(LANES) {
        let (p, q): (&Pixels, &Pixels) = (window(p, x), window(q, x));
        let distances: &[f32; D] = window(distances, x);
        let p_sums: &mut Sums = window_mut(p_sums, x);
        let q_sums: &mut Sums = window_mut(q_sums, x);
        let mut weights = [[0.0; LANES]; 2];
        for l in 0..LANES {
            // Compare features
            let albedo = squared_distance(p, q, ALBEDO, l);
            let normal = squared_distance(p, q, NORMAL, l);
            let tolerance = smaller(tolerance(p, scale, l), tolerance(q, scale, l));
            let z = (p[DEPTH * STRIDE + l] - q[DEPTH * STRIDE + l]) / tolerance;
            let feature = larger(larger(albedo, normal), z * z);
            // Sum the colour distances over the patch
            let (mut even, mut odd) = (distances[l], distances[STRIDE + l]);
            for row in 1..N {
                even += distances[2 * row * STRIDE + l];
                odd += distances[(2 * row + 1) * STRIDE + l];
            }
            let (even, odd) = (even * color, odd * color);
            weights[0][l] = weight_of(larger(larger(odd, even * own), feature));
            weights[1][l] = weight_of(larger(larger(even, odd * own), feature));
        }
        let [even, odd] = &weights;
        move_together(p, q, EVEN, even, p_sums, q_sums);
        move_together(p, q, EVEN + 1, even, p_sums, q_sums);
        move_together(p, q, EVEN + 2, even, p_sums, q_sums);
        move_together(p, q, ODD, odd, p_sums, q_sums);
        move_together(p, q, ODD + 1, odd, p_sums, q_sums);
        move_together(p, q, ODD + 2, odd, p_sums, q_sums);
        for l in 0..LANES {
            p_sums[WEIGHTS * STRIDE + l] += even[l];
            q_sums[WEIGHTS * STRIDE + l] += even[l];
        }
        for l in 0..LANES {
            p_sums[(WEIGHTS + 1) * STRIDE + l] += odd[l];
            q_sums[(WEIGHTS + 1) * STRIDE + l] += odd[l];
        }
    }
}

/// Adds the weighted difference of `p` and `q` in `plane` to the sums of `p`, and subtracts it from those of `q`.
#[inline(always)]
fn move_together(
    p: &Pixels,
    q: &Pixels,
    plane: usize,
    weights: &[f32; LANES],
    p_sums: &mut Sums,
    q_sums: &mut Sums,
) {
    let at = plane * STRIDE;
    for l in 0..LANES {
        let moved = weights[l] * (q[at + l] - p[at + l]);
        p_sums[at + l] += moved;
        q_sums[at + l] -= moved;
    }
}

lane_kernel! {
    pub(super) fn pairs_3(
        p: &[f32], q: &[f32], count: usize, scale: &WeightScale, distances: &[f32], p_sums: &mut [f32],
        q_sums: &mut [f32],
    ) = pairs_body::<3, { window_len(6) }>;
}
lane_kernel! {
    pub(super) fn pairs_5(
        p: &[f32], q: &[f32], count: usize, scale: &WeightScale, distances: &[f32], p_sums: &mut [f32],
        q_sums: &mut [f32],
    ) = pairs_body::<5, { window_len(10) }>;
}
