//! Percentiles of samples, and the spacing of particles.

use glam::DVec3;
use rayon::prelude::*;
use spherule_formats::{Positions, sample_indices};

use super::neighbours::Coordinates;
use super::packing::{self, Spacing, SpacingRequest};

/// Number of particles of a frame from which percentiles are computed.
pub(super) const SAMPLE: usize = 20_000;
/// Minimum number of particles for which a single one may be treated as an outlier.
pub(super) const ESCAPE_MIN: usize = 16;
/// Number of nearest-neighbour distances from which the radius is estimated.
pub(super) const NEIGHBOUR_QUERIES: usize = 512;
/// Minimum number of these distances, whatever they cost.
const MIN_NEIGHBOUR_QUERIES: usize = 16;
/// Maximum number of distance computations for the estimates of all frames: half a second on one thread.
const NEIGHBOUR_BUDGET: usize = 1_000_000_000;

/// Number of distances for the estimate of a frame of `count` particles, which is one of `frames`.
pub(super) fn neighbour_queries(count: usize, frames: usize) -> usize {
    let affordable = NEIGHBOUR_BUDGET / frames.max(1) / count.max(1);
    affordable.clamp(MIN_NEIGHBOUR_QUERIES, NEIGHBOUR_QUERIES)
}

/// Boxes of the particles of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RobustBounds {
    /// Corners of the box of the particles without outliers.
    pub(super) outer: (DVec3, DVec3),
    /// On each axis, the values with 1 / [`LAYER`] of the particles below, and above.
    pub(super) layers: (DVec3, DVec3),
}

impl RobustBounds {
    /// The boxes of two frames.
    pub(super) fn and(self, other: Self) -> Self {
        let enclose = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0.min(b.0), a.1.max(b.1));
        Self { outer: enclose(self.outer, other.outer), layers: enclose(self.layers, other.layers) }
    }
}

/// If the middle 90 % of the particles would be smaller than this part of the box of the middle 98 %, the box is theirs: a
/// share of particles at a great distance leaves nothing to see of the others.
pub(super) const TOO_SMALL: f64 = 1.0 / 25.0;

/// One particle of this many may be left out then.
pub(super) const MAX_FAR: usize = 10;

/// A frame's lowest layer is one of this many parts of its particles.
const LAYER: usize = 200;

/// An even selection of up to [`SAMPLE`] of the `positions`, without those that are not finite.
pub(super) fn sample_of(positions: &Positions) -> Vec<DVec3> {
    let sample = sample_indices(positions.len(), SAMPLE).map(|i| positions.get(i));
    sample.filter(|p| p.is_finite()).collect()
}

/// The box of the particles, limited on each axis to half the extent of the middle 98 % beyond them. None without
/// finite particles. `extremes` is the box of all particles if `positions` are only a part of them.
///
/// Below 100 particles, 98 % would include all. There the outermost particle on each side of an axis is excluded, and
/// the limit is the longest side of the box of the rest: one of a few particles that is outside the plane of the
/// others belongs to the picture.
pub(super) fn robust_bounds(
    positions: &Positions,
    extremes: Option<(DVec3, DVec3)>,
) -> Option<RobustBounds> {
    let count = positions.len();
    let finite = |i| Some(positions.get(i)).filter(|p: &DVec3| p.is_finite());
    let outermost = || {
        let all = (0..count).into_par_iter().filter_map(finite);
        all.map(|p| (p, p)).reduce_with(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    };
    let (min, max) = extremes.or_else(outermost)?;
    // Decide how many particles may be outside on each side
    let mut sample = sample_of(positions);
    let few = sample.len() < 100;
    let outside = match sample.len() / 100 {
        0 => usize::from(sample.len() >= ESCAPE_MIN),
        percent => percent,
    };
    // Find the middle of each axis, and the outer layers
    let (mut first, mut last) = (min, max);
    let mut layers = (min, max);
    let tail = sample.len() / (2 * MAX_FAR);
    let (mut near_first, mut near_last) = (min, max);
    for axis in 0..3 {
        sample.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
        if let Some(found) = axis_ends(&sample, axis, outside) {
            [first[axis], last[axis]] = found;
        }
        if let Some(found) = axis_ends(&sample, axis, tail) {
            [near_first[axis], near_last[axis]] = found;
        }
        let layer = sample.len() / LAYER;
        if let (Some(low), Some(high)) = (sample.get(layer), sample.iter().nth_back(layer)) {
            layers.0[axis] = low[axis];
            layers.1[axis] = high[axis];
        }
    }
    // A share of particles at a great distance
    let is_scattered = tail > 0
        && (near_last - near_first).max_element() < TOO_SMALL * (last - first).max_element();
    if is_scattered {
        (first, last) = (near_first, near_last);
    }
    // Limit the box to a margin around it
    let extent = last - first;
    let margin = if few { DVec3::splat(extent.max_element()) } else { 0.5 * extent };
    Some(RobustBounds { outer: (min.max(first - margin), max.min(last + margin)), layers })
}

/// The ends of `sample`, which is sorted along `axis`, without `outside` particles on each side.
fn axis_ends(sample: &[DVec3], axis: usize, outside: usize) -> Option<[f64; 2]> {
    let above = (sample.len() - outside).saturating_sub(1);
    Some([sample.get(outside)?[axis], sample.get(above)?[axis]])
}

/// The 99th percentile of `count` radii; 0 without finite ones.
pub(super) fn robust_largest(count: usize, radius: impl Fn(usize) -> f32) -> f32 {
    let mut radii: Vec<f32> =
        sample_indices(count, SAMPLE).map(radius).filter(|r| r.is_finite() && *r > 0.0).collect();
    radii.sort_unstable_by(f32::total_cmp);
    let place = (radii.len() - radii.len() / 100).saturating_sub(1);
    radii.get(place).copied().unwrap_or(0.0)
}

/// Up to [`SAMPLE`] of the `count` values that are finite, rising.
pub(super) fn sorted_sample(count: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut values: Vec<f64> =
        sample_indices(count, SAMPLE).map(value).filter(|v| v.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// The range of the middle 99 % of `values`, which rise.
pub(super) fn robust_range(values: &[f64]) -> Option<(f64, f64)> {
    let low = *values.get(values.len() / 200)?;
    let high = *values.get((values.len() - values.len() / 200).saturating_sub(1))?;
    Some((low, high))
}

/// A percentile of `values`, which rise, interpolated as in numpy.
pub(super) fn percentile(values: &[f64], percent: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    #[expect(clippy::cast_precision_loss, reason = "samples are few")]
    let at = percent / 100.0 * last as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "limited to the values"
    )]
    let index = (at.max(0.0) as usize).min(last);
    let (low, high) = (values[index], values[(index + 1).min(last)]);
    #[expect(clippy::cast_precision_loss, reason = "samples are few")]
    let part = at - index as f64;
    Some(low + part * (high - low))
}

/// The spacing of neighbours among `positions`.
pub(super) fn spacing_of(positions: &Coordinates, request: SpacingRequest) -> Option<Spacing> {
    let count = neighbour_queries(positions.len(), request.frames);
    let queries = || sample_indices(positions.len(), count).map(|i| positions.get(i));
    let squares = queries().map(|from| positions.nearest_square(from));
    let distances = squares.filter(|square| square.is_finite()).map(f32::sqrt).collect();
    let (touching, closest) = half_median_and_least(distances)?;
    let packed = || {
        let square = packing::reach(touching).powi(2);
        let counts = queries().map(|from| positions.count_within(from, square));
        packing::packed_radius(touching, counts.collect())
    };
    Some(Spacing { touching, closest, packed: request.needs_packed.then(packed).flatten() })
}

/// Half the median of `distances`, and half of what one of a hundred has at most.
pub(super) fn half_median_and_least(mut distances: Vec<f32>) -> Option<(f32, f32)> {
    distances.sort_unstable_by(f32::total_cmp);
    let at = |place: usize| distances.get(place).map(|d| 0.5 * d);
    Some((at(distances.len() / 2)?, at(distances.len() / 100)?))
}

/// The median of `values`.
pub(super) fn median(mut values: Vec<f32>) -> Option<f32> {
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bounds of `side` by `side` particles in the unit square of a plane, and one other particle.
    fn plane_and(side: u8, other: DVec3) -> (DVec3, DVec3) {
        let step = |i: u8| f64::from(i) / f64::from(side - 1);
        let mut all: Vec<DVec3> = (0..side)
            .flat_map(|i| (0..side).map(move |j| DVec3::new(step(i), step(j), 0.0)))
            .collect();
        all.push(other);
        robust_bounds(&Positions::F64(all), None).unwrap().outer
    }

    #[test]
    fn percentiles_are_those_of_numpy() {
        // numpy.percentile([1, 2, 4, 8, 16], [0, 1, 50, 90, 100])
        let values = [1.0, 2.0, 4.0, 8.0, 16.0];
        for (percent, expected) in
            [(0.0, 1.0), (1.0, 1.04), (50.0, 4.0), (90.0, 12.8), (100.0, 16.0)]
        {
            let found = percentile(&values, percent).unwrap();
            assert!((found - expected).abs() < 1e-12, "{percent}: {found}");
        }
        assert_eq!(percentile(&[], 50.0), None);
    }

    #[test]
    fn layers_contain_half_a_percent() {
        let line: Vec<DVec3> =
            (0..1000).map(|i| f64::from(i) * DVec3::new(1.0, -2.0, 0.0)).collect();
        let layers = robust_bounds(&Positions::F64(line), None).unwrap().layers;
        assert_eq!(layers.0, DVec3::new(5.0, -1988.0, 0.0));
        assert_eq!(layers.1, DVec3::new(994.0, -10.0, 0.0));
    }

    #[test]
    fn bounds_exclude_a_single_outlier() {
        for side in [5, 20] {
            for escaped in [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z] {
                let (min, max) = plane_and(side, 1e4 * escaped);
                assert!(min.min_element() >= -1.0, "{side} {escaped}: {min}");
                assert!(max.max_element() <= 2.0, "{side} {escaped}: {max}");
                assert!(min.x <= 0.0 && min.y <= 0.0 && max.x >= 1.0 && max.y >= 1.0);
            }
        }
    }

    #[test]
    fn bounds_exclude_a_share_at_a_great_distance() {
        let at = |i: u32| {
            let near = DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100));
            if i % 25 == 3 { near + 1e5 * near } else { near }
        };
        let all: Vec<DVec3> = (0..1000).map(at).collect();
        let (min, max) = robust_bounds(&Positions::F64(all), None).unwrap().outer;
        assert!(min.min_element() >= -5.0 && max.max_element() <= 14.0, "{min} {max}");
    }

    #[test]
    fn bounds_include_a_near_particle_of_a_few() {
        assert_eq!(plane_and(5, DVec3::new(0.5, 0.5, 0.9)).1.z, 0.9);
        // Of fewer than sixteen particles, none is omitted.
        assert_eq!(plane_and(3, DVec3::new(0.5, 0.5, 1e4)).1.z, 1e4);
    }
}
