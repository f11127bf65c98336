//! The filter by its formulas, one pair of pixels after another in double precision: the reference of tests.

use std::collections::HashMap;

use glam::{DVec3, DVec4, Vec3};

use super::gather::{
    DEPTHS, MAX_VALUE, MIN_ALBEDO, MIN_NOISE, NOISE_WEIGHTS, RELATIVE_NOISE, UNUSABLE_NOISE,
};
use super::glints::{LIMITS, RADIUS};
use super::kernels::MAX_DISTANCE;
use super::settings::{
    ALBEDO_TOLERANCE, DEPTH_TOLERANCE, NORMAL_TOLERANCE, OWN_PART, SLOPE_TOLERANCE,
};
use super::{DenoiseInput, DenoiseSettings};

/// Column and row; pixels beside the image have those of the nearest pixel at its edge.
type Position = [i64; 2];

/// Positions up to `radius` away from `center`.
fn square(center: Position, radius: i64) -> impl Iterator<Item = Position> {
    let offsets = move || -radius..=radius;
    offsets().flat_map(move |y| offsets().map(move |x| [center[0] + x, center[1] + y]))
}

/// The filtered picture.
pub(super) fn denoise(input: &DenoiseInput<'_>, settings: &DenoiseSettings) -> Vec<DVec4> {
    let mut picture = Picture { input, limits: Vec::new(), noise: HashMap::new() };
    let (width, height) = (i64::from(input.width), i64::from(input.height));
    let rows = |border: i64| {
        let columns = move |y| (-border..width + border).map(move |x| [x, y]);
        (-border..height + border).flat_map(columns)
    };
    picture.limits = rows(0).map(|p| picture.limit(p)).collect();
    picture.noise = rows(1).map(|p| (p, picture.noise_at(p))).collect();
    rows(0).map(|p| picture.filtered(p, settings)).collect()
}

struct Picture<'a> {
    input: &'a DenoiseInput<'a>,
    /// The limits of all pixels.
    limits: Vec<f64>,
    /// The noise of all pixels, and of those in patches at the edges.
    noise: HashMap<Position, f64>,
}

impl Picture<'_> {
    fn is_inside(&self, [x, y]: Position) -> bool {
        let (width, height) = (i64::from(self.input.width), i64::from(self.input.height));
        (0..width).contains(&x) && (0..height).contains(&y)
    }

    fn index(&self, [x, y]: Position) -> usize {
        let (width, height) = (i64::from(self.input.width), i64::from(self.input.height));
        let index = y.clamp(0, height - 1) * width + x.clamp(0, width - 1);
        usize::try_from(index).expect("a small picture")
    }

    /// Whether all values of a pixel are finite.
    fn is_usable(&self, p: Position) -> bool {
        let (input, i) = (self.input, self.index(p));
        let [color, odd] =
            [input.color[i], input.odd[i]].map(|rgba| self.compared(i, rgba).as_vec3());
        let vectors = [color, odd, input.albedo[i], input.normal[i]];
        let sum: f32 = vectors.iter().map(|v| v.abs().element_sum()).sum();
        sum <= MAX_VALUE
    }

    /// The depth of an intersection inside the image.
    fn depth(&self, p: Position) -> Option<f64> {
        let depth = self.input.depth[self.index(p)];
        let is_valid = self.is_inside(p) && (DEPTHS[0]..=DEPTHS[1]).contains(&depth);
        is_valid.then_some(f64::from(depth))
    }

    /// What colours are divided by.
    fn divisor(&self, p: Position) -> DVec3 {
        let i = self.index(p);
        if (DEPTHS[0]..=DEPTHS[1]).contains(&self.input.depth[i]) {
            self.input.albedo[i].as_dvec3().max(DVec3::splat(MIN_ALBEDO.into()))
        } else {
            DVec3::ONE
        }
    }

    /// Whether pixel `i` shows a transparent background.
    fn is_background(&self, i: usize) -> bool {
        self.input.is_transparent && !(DEPTHS[0]..=DEPTHS[1]).contains(&self.input.depth[i])
    }

    /// The colour by which a pixel is compared.
    fn compared(&self, i: usize, [r, g, b, coverage]: [f32; 4]) -> DVec3 {
        let behind = if self.is_background(i) { 1.0 - f64::from(coverage) } else { 0.0 };
        Vec3::new(r, g, b).as_dvec3() + behind
    }

    /// The coverage of both halves.
    fn coverages(&self, p: Position) -> [f64; 2] {
        let i = self.index(p);
        let [mean, odd] = [self.input.color[i][3], self.input.odd[i][3]].map(f64::from);
        let [even_share, odd_share] = self.shares();
        [(mean - odd * odd_share) / even_share, odd]
    }

    /// Parts of the samples in both halves.
    fn shares(&self) -> [f64; 2] {
        let odd = f64::from(self.input.samples / 2) / f64::from(self.input.samples);
        [1.0 - odd, odd]
    }

    /// The colours of both halves without albedo, within the limit of a glint.
    fn halves(&self, p: Position) -> [DVec3; 2] {
        let limit = DVec3::splat(self.limits[self.index(p)]);
        self.unlimited(p).map(|half| half.clamp(-limit, limit))
    }

    /// The limit of a pixel.
    fn limit(&self, p: Position) -> f64 {
        let brightness = |p| {
            let [even, odd] = self.unlimited(p).map(|half| half.abs().max_element());
            even.max(odd)
        };
        let around = square(p, i64::try_from(RADIUS).expect("few"));
        let mut others: Vec<f64> =
            around.filter(|q| *q != p && self.is_inside(*q)).map(brightness).collect();
        others.sort_by(|a, b| b.total_cmp(a));
        if others.is_empty() {
            return f64::INFINITY;
        }
        let limits =
            LIMITS.map(|(alike, factor)| f64::from(factor) * others[alike.min(others.len()) - 1]);
        let lower = limits.into_iter().filter(|limit| brightness(p) > *limit);
        lower.fold(f64::INFINITY, f64::min)
    }

    /// The colours of both halves without albedo.
    fn unlimited(&self, p: Position) -> [DVec3; 2] {
        if !self.is_usable(p) {
            return [DVec3::ZERO; 2];
        }
        let i = self.index(p);
        let [mean, odd] =
            [self.input.color[i], self.input.odd[i]].map(|rgba| self.compared(i, rgba));
        let [even_share, odd_share] = self.shares();
        let even = (mean - odd * odd_share) / even_share;
        [even, odd].map(|half| half / self.divisor(p))
    }

    /// The variance of a half.
    fn noise_at(&self, p: Position) -> f64 {
        if !self.is_usable(p) {
            return UNUSABLE_NOISE.into();
        }
        let variance = |q| {
            let [even, odd] = self.halves(q);
            (even - odd).length_squared() / 2.0
        };
        let weights = NOISE_WEIGHTS.iter().flat_map(|y| NOISE_WEIGHTS.map(|x| f64::from(x * y)));
        let weighted = square(p, 2).zip(weights).map(|(q, weight)| weight * variance(q));
        let mean = weighted.sum::<f64>() / 81.0;
        let [even, odd] = self.halves(p);
        let relative = (even + odd).length() / 2.0 * f64::from(RELATIVE_NOISE);
        mean + relative * relative + f64::from(MIN_NOISE)
    }

    /// The distance of two pixels of a half.
    fn distance(&self, p: Position, q: Position, half: usize) -> f64 {
        let [p_noise, q_noise] = [p, q].map(|p| self.noise[&p]);
        let difference = self.halves(p)[half].distance_squared(self.halves(q)[half]);
        let expected = 2.0 * p_noise.min(q_noise);
        ((difference - expected) / (p_noise + q_noise)).min(MAX_DISTANCE.into())
    }

    /// The distance of two patches of a half.
    fn patch_distance(&self, p: Position, q: Position, half: usize, k: f32) -> f64 {
        let pairs = square(p, 1).zip(square(q, 1));
        let sum: f64 = pairs.map(|(p, q)| self.distance(p, q, half)).sum();
        sum / 9.0 / f64::from(k).powi(2)
    }

    /// The lesser slope of depth with the neighbours of `p` on an axis.
    fn slope(&self, p: Position, axis: usize) -> f64 {
        let difference = |offset| {
            let mut neighbour = p;
            neighbour[axis] += offset;
            let (at, other) = (self.depth(p)?, self.depth(neighbour)?);
            Some((at - other).abs())
        };
        let slopes = [-1, 1].into_iter().filter_map(difference);
        slopes.reduce(f64::min).unwrap_or(0.0)
    }

    /// The squared difference of depth relative to its tolerance.
    fn depth_distance(&self, p: Position, q: Position) -> f64 {
        let tolerance = |at, depth| {
            let slopes = [0, 1].map(|axis| self.slope(at, axis) * (p[axis] - q[axis]).abs() as f64);
            f64::from(SLOPE_TOLERANCE) * (slopes[0] + slopes[1])
                + f64::from(DEPTH_TOLERANCE) * depth
        };
        match (self.depth(p), self.depth(q)) {
            (Some(p_depth), Some(q_depth)) => {
                let tolerance = tolerance(p, p_depth).min(tolerance(q, q_depth));
                ((p_depth - q_depth) / tolerance).powi(2)
            }
            (None, None) => 0.0,
            _ => f64::INFINITY,
        }
    }

    /// The largest distance of features.
    fn feature_distance(&self, p: Position, q: Position) -> f64 {
        let distance = |feature: &[Vec3], tolerance: f32| {
            let [p, q] = [p, q].map(|p| feature[self.index(p)].as_dvec3());
            p.distance_squared(q) / f64::from(tolerance).powi(2)
        };
        distance(self.input.albedo, ALBEDO_TOLERANCE)
            .max(distance(self.input.normal, NORMAL_TOLERANCE))
            .max(self.depth_distance(p, q))
    }

    /// The weights of `q` for both halves of `p`.
    fn weights(&self, p: Position, q: Position, k: f32) -> [f64; 2] {
        let feature = self.feature_distance(p, q);
        let [even, odd] = [0, 1].map(|half| self.patch_distance(p, q, half, k));
        [[odd, even], [even, odd]].map(|[other, own]| {
            let distance = other.max(own * f64::from(OWN_PART)).max(feature);
            (1.0 - distance / 8.0).max(0.0).powi(8)
        })
    }

    fn filtered(&self, p: Position, settings: &DenoiseSettings) -> DVec4 {
        let rgba = self.input.color[self.index(p)];
        let color = Vec3::from_slice(&rgba).as_dvec3();
        let coverage = f64::from(rgba[3]);
        if !self.is_usable(p) {
            return color.extend(coverage);
        }
        let (halves, coverages) = (self.halves(p), self.coverages(p));
        let (mut changes, mut covered) = ([DVec3::ZERO; 2], [0.0; 2]);
        let mut sums = [1.0; 2];
        for q in square(p, settings.search.into()) {
            if q == p || !self.is_inside(q) || !self.is_usable(q) {
                continue;
            }
            let weights = self.weights(p, q, settings.k);
            for half in 0..2 {
                changes[half] += weights[half] * (self.halves(q)[half] - halves[half]);
                covered[half] += weights[half] * (self.coverages(q)[half] - coverages[half]);
                sums[half] += weights[half];
            }
        }
        let shares = self.shares();
        let change = changes[0] / sums[0] * shares[0] + changes[1] / sums[1] * shares[1];
        let covered = if self.is_background(self.index(p)) {
            covered[0] / sums[0] * shares[0] + covered[1] / sums[1] * shares[1]
        } else {
            0.0
        };
        let changed = color + self.divisor(p) * change + covered;
        changed.max(color.min(DVec3::ZERO)).extend(coverage + covered)
    }
}
