//! The particles at the outside of a sequence, for cameras that show all of it.

use std::collections::HashSet;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use spherule_formats::{Positions, sample_indices};

use super::robust::{ESCAPE_MIN, MAX_FAR, TOO_SMALL, sample_of};

/// Number of axes along which the outermost particles are found, in both directions.
const AXES: usize = 64;

/// Number of particles of a frame from which the layers next to the outermost particles are found.
const LAYER_SAMPLE: usize = 2000;

/// One particle of this many may be an outlier on each side of an axis.
const OUTSIDE: usize = 1000;

/// Distance from the other particles beyond which these are outliers, as a fraction of the extent of the others.
const MARGIN: f64 = 0.25;

/// The same for a share of all particles, whose layers leave out more of them: the corners of a box are far
/// from the layers in the directions of its diagonals.
const SHARE_MARGIN: f64 = 0.5;

/// Below this number, a particle may be as far from the others as their extent.
const FEW: usize = 100;

/// From that number on, at most one particle of this many is an outlier: more are a part of the picture.
const MAX_OUTLIERS: usize = 100;

/// Outliers are left out if the box of all particles is at least this many times as long as that of the others. A
/// splash that is cut off looks worse than one in a somewhat smaller picture.
const MIN_GAIN: f64 = 1.5;

/// Number of particles of a frame that are kept to find the outermost ones of all frames together.
const KEPT: usize = 16_384;

/// Which particles an outline is about.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Fit {
    /// All of each frame, except at most 1 % that are far from the others in it.
    #[default]
    All,
    /// At least this part of those of all frames together. The others are left out if they are far from these.
    Share(f64),
}

/// The outermost particles over a sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outline {
    /// Positions of particles relative to the origin of the sequence. A view of all of them shows the others as well,
    /// except outliers.
    pub points: Vec<Vec3>,
    /// Number of outliers in the frame with the most, about, as frames may be sampled.
    pub outliers: u64,
}

/// The outermost particles of the frames so far.
#[derive(Default)]
pub(super) struct Outermost {
    /// The outermost particle at the lower end of each axis and at the upper one, with its distance along the axis.
    ends: Vec<[End; 2]>,
    outliers: u64,
    /// Some particles of each frame, for a share of all.
    kept: Vec<Kept>,
}

/// Some particles of a frame.
struct Kept {
    points: Vec<DVec3>,
    /// Number of particles that each of them stands for.
    each: usize,
}

#[derive(Clone, Copy)]
struct End {
    along: f64,
    point: DVec3,
}

impl Outermost {
    /// Adds a frame of `count` particles. `positions`: those of all of them, or of some.
    pub(super) fn add(&mut self, positions: &Positions, count: usize) {
        // Keep some of the particles, for the outline of all frames together
        let mut sample = sample_of(positions);
        if sample.is_empty() {
            return;
        }
        let points: Vec<DVec3> = sample_indices(sample.len(), KEPT).map(|i| sample[i]).collect();
        let each = count.div_ceil(points.len());
        self.kept.push(Kept { points, each });
        // A particle that is far from the others along one axis is an outlier on all
        let axes = || (0..AXES).into_par_iter().map(axis);
        let few = outside(sample.len());
        let side = longest_side(&sample, few);
        let is_scattered = is_scattered(&sample, side);
        let (tail, longest) = if is_scattered {
            let tail = few.max(sample.len().min(LAYER_SAMPLE) / (2 * MAX_FAR));
            (tail, longest_side(&sample, tail))
        } else {
            (few, side)
        };
        // Find the outliers along all axes, and leave out those that are farthest
        let found = axes().flat_map_iter(|axis| beyond(&sample, axis, longest, (tail, MARGIN)));
        let most = match sample.len() {
            many if is_scattered => many.div_ceil(MAX_FAR),
            0..FEW => usize::MAX,
            many => many / MAX_OUTLIERS,
        };
        let outliers = worth_leaving_out(&sample, farthest(found.collect(), most));
        let each = count.div_ceil(sample.len()).max(1);
        self.outliers = self.outliers.max((outliers.len() * each) as u64);
        for index in outliers.into_iter().rev() {
            sample.swap_remove(index);
        }
        // Join the ends with those of the frames before
        let found: Vec<[End; 2]> = axes().filter_map(|axis| ends_along(&sample, axis)).collect();
        if self.ends.is_empty() {
            self.ends.clone_from(&found);
        }
        for (known, [low, high]) in self.ends.iter_mut().zip(found) {
            if low.along < known[0].along {
                known[0] = low;
            }
            if high.along > known[1].along {
                known[1] = high;
            }
        }
    }

    /// The outline for `fit`, relative to `origin`; `None` without a particle.
    pub(super) fn outline(mut self, fit: Fit, origin: DVec3) -> Option<Outline> {
        if let Fit::Share(share) = fit {
            self.keep(share);
        }
        let mut points: Vec<Vec3> = Vec::new();
        for end in self.ends.into_iter().flatten() {
            let point = (end.point - origin).as_vec3();
            if !points.contains(&point) {
                points.push(point);
            }
        }
        let outliers = self.outliers;
        (!points.is_empty()).then_some(Outline { points, outliers })
    }
}

impl Outermost {
    /// Finds the outermost particles of a `share` of all frames together.
    fn keep(&mut self, share: f64) {
        // Find out how many may be left out
        let all: Vec<DVec3> = self.kept.iter().flat_map(|frame| &frame.points).copied().collect();
        if all.is_empty() {
            return;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a part of a sample"
        )]
        let left_out = ((1.0 - share.clamp(0.0, 1.0)) * all.len() as f64) as usize;
        let side = longest_side(&all, outside(all.len()));
        let most =
            if is_scattered(&all, side) { left_out.max(all.len() / MAX_FAR) } else { left_out };
        if most == 0 {
            return;
        }
        // The layers must not be those of the particles that may be left out
        let tail = (most * LAYER_SAMPLE.min(all.len()) / all.len()).max(outside(all.len()));
        let longest = longest_side(&all, tail);
        let axes = || (0..AXES).into_par_iter().map(axis);
        let found = axes().flat_map_iter(|axis| beyond(&all, axis, longest, (tail, SHARE_MARGIN)));
        // Leave them out
        let outliers = worth_leaving_out(&all, farthest(found.collect(), most));
        let outliers: HashSet<usize> = outliers.into_iter().collect();
        let indices = 0..all.len();
        let rest: Vec<DVec3> = indices.filter(|i| !outliers.contains(i)).map(|i| all[i]).collect();
        // Count the outliers of each frame
        let mut first = 0;
        self.outliers = 0;
        for frame in &self.kept {
            let own = first..first + frame.points.len();
            let outside = own.clone().filter(|i| outliers.contains(i)).count();
            self.outliers = self.outliers.max((outside * frame.each) as u64);
            first = own.end;
        }
        self.ends = axes().filter_map(|axis| ends_along(&rest, axis)).collect();
    }
}

/// Number of particles beyond a layer of the outermost ones of a sample of `count`.
fn outside(count: usize) -> usize {
    match count.min(LAYER_SAMPLE) / OUTSIDE {
        0 => usize::from(count >= ESCAPE_MIN),
        some => some,
    }
}

/// Positions along `axis` of the layers beyond which are only the outermost particles of a `sample`, `outside` of
/// [`LAYER_SAMPLE`].
fn layers(sample: &[DVec3], axis: DVec3, outside: usize) -> [f64; 2] {
    let some = sample_indices(sample.len(), LAYER_SAMPLE);
    let mut along: Vec<f64> = some.map(|i| sample[i].dot(axis)).collect();
    let outside = outside.min((along.len() - 1) / 2);
    let last = along.len() - 1;
    [outside, last - outside].map(|place| *along.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// The longest side of the box of a `sample` without the outermost particles, `outside` of [`LAYER_SAMPLE`] on each side.
fn longest_side(sample: &[DVec3], outside: usize) -> f64 {
    let sides = DVec3::AXES.map(|axis| {
        let [low, high] = layers(sample, axis, outside);
        high - low
    });
    sides.into_iter().fold(0.0, f64::max)
}

/// Whether the middle 90 % of a `sample` along each axis are within a small part of a box whose side is `longest`.
fn is_scattered(sample: &[DVec3], longest: f64) -> bool {
    let tail = sample.len().min(LAYER_SAMPLE) / (2 * MAX_FAR);
    tail > 0 && longest_side(sample, tail) < TOO_SMALL * longest
}

/// A particle of a sample that is far from the others along an axis.
#[derive(Clone, Copy)]
struct Outlier {
    index: usize,
    /// Distance from the others.
    distance: f64,
}

/// The particles of a `sample` that are far from the others along `axis`. `longest` is the longest side of the box of
/// the others.
fn beyond(
    sample: &[DVec3],
    axis: DVec3,
    longest: f64,
    (outside, part): (usize, f64),
) -> Vec<Outlier> {
    let [low, high] = layers(sample, axis, outside);
    let margin = if sample.len() < FEW { longest } else { part * (high - low) };
    let outliers = sample.iter().enumerate().map(|(index, p)| {
        let along = p.dot(axis);
        let distance = (low - along).max(along - high);
        Outlier { index, distance }
    });
    outliers.filter(|o| o.distance > margin).collect()
}

/// The indices of `outliers`, which may be there once for each axis, rising: those of the farthest particles, if there are
/// more than `most`.
fn farthest(mut outliers: Vec<Outlier>, most: usize) -> Vec<usize> {
    // Keep the axis along which a particle is farthest
    outliers.sort_unstable_by(|a, b| {
        let farther = b.distance.total_cmp(&a.distance);
        a.index.cmp(&b.index).then(farther)
    });
    outliers.dedup_by_key(|outlier| outlier.index);
    if outliers.len() > most {
        outliers.sort_by(|a, b| b.distance.total_cmp(&a.distance));
        outliers.truncate(most);
        outliers.sort_unstable_by_key(|outlier| outlier.index);
    }
    outliers.into_iter().map(|outlier| outlier.index).collect()
}

/// The indices of `outliers`, rising, or none if the picture of the others would be hardly larger.
fn worth_leaving_out(sample: &[DVec3], outliers: Vec<usize>) -> Vec<usize> {
    if outliers.is_empty() {
        return outliers;
    }
    let mut left_out = outliers.iter().peekable();
    let (mut all, mut others) = (Extent::NONE, Extent::NONE);
    for (index, point) in sample.iter().enumerate() {
        all.add(*point);
        if left_out.next_if_eq(&&index).is_none() {
            others.add(*point);
        }
    }
    if all.longest() < MIN_GAIN * others.longest() { Vec::new() } else { outliers }
}

/// A box along the coordinate axes.
struct Extent {
    low: DVec3,
    high: DVec3,
}

impl Extent {
    const NONE: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    fn add(&mut self, point: DVec3) {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
    }

    fn longest(&self) -> f64 {
        (self.high - self.low).max_element()
    }
}

/// The lowest and the highest particle of a `sample` along `axis`, the first in a tie; `None` without particles.
fn ends_along(sample: &[DVec3], axis: DVec3) -> Option<[End; 2]> {
    let ends = sample.iter().map(|point| End { along: point.dot(axis), point: *point });
    ends.map(|end| [end; 2]).reduce(|[low, high], [end, _]| {
        [
            if end.along < low.along { end } else { low },
            if end.along > high.along { end } else { high },
        ]
    })
}

/// Unit vector of an axis: the coordinate axes, and then points of a half sphere, evenly on a spiral (Gonzalez,
/// "Measurement of areas on a sphere using Fibonacci and latitude-longitude lattices", 2010).
fn axis(number: usize) -> DVec3 {
    if let Some(axis) = DVec3::AXES.get(number) {
        return *axis;
    }
    let place = (number - DVec3::AXES.len()) as f64 + 0.5;
    let z = place / (AXES - DVec3::AXES.len()) as f64;
    let radius = (1.0 - z * z).sqrt();
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let angle = golden_angle * place;
    DVec3::new(radius * libm::cos(angle), radius * libm::sin(angle), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(frames: &[&[DVec3]]) -> Outline {
        let mut outermost = Outermost::default();
        for frame in frames {
            outermost.add(&Positions::F64(frame.to_vec()), frame.len());
        }
        outermost.outline(Fit::All, DVec3::ZERO).unwrap()
    }

    fn doubles(outline: &Outline) -> Vec<DVec3> {
        outline.points.iter().map(|p| p.as_dvec3()).collect()
    }

    /// `count` points of a ball of radius 1.
    fn ball(count: usize) -> Vec<DVec3> {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 23) - 1.0
        };
        let mut points = Vec::new();
        while points.len() < count {
            let point = DVec3::new(uniform(), uniform(), uniform());
            if point.length() <= 1.0 {
                points.push(point);
            }
        }
        points
    }

    #[test]
    fn an_outline_reaches_nearly_as_far_as_all_particles_in_each_direction() {
        let points = ball(15_000);
        let outline = outline(&[&points]);
        assert!(outline.points.len() <= 2 * AXES);
        for direction in ball(200) {
            let direction = direction.normalize();
            let most = |points: &[DVec3]| {
                let along = points.iter().map(|p| p.dot(direction));
                along.fold(f64::NEG_INFINITY, f64::max)
            };
            let missing = most(&points) - most(&doubles(&outline));
            assert!((-1e-6..0.05).contains(&missing), "{missing}");
        }
        assert_eq!(outline.outliers, 0);
    }

    #[test]
    fn corners_of_a_box_and_all_frames_are_in_an_outline() {
        let corners = |at: DVec3| -> Vec<DVec3> {
            let side = |bit: usize| if bit == 0 { 0.0 } else { 1.0 };
            (0..8).map(|i| at + DVec3::new(side(i & 1), side(i & 2), side(i & 4))).collect()
        };
        let (first, second) = (corners(DVec3::ZERO), corners(5.0 * DVec3::X));
        let outline = outline(&[&first, &second]);
        for corner in [first[0], first[6], second[1], second[7]].map(DVec3::as_vec3) {
            assert!(outline.points.contains(&corner), "{corner}");
        }
        assert!(!outline.points.contains(&second[0].as_vec3()));
    }

    #[test]
    fn an_outlier_is_counted_and_left_out() {
        for count in [50, 3000] {
            let mut points = ball(count);
            points.push(DVec3::new(0.0, 900.0, 30.0));
            let outline = outline(&[&points, &ball(20)]);
            assert!(outline.points.iter().all(|p| p.length() <= 1.0 + 1e-6));
            assert_eq!(outline.outliers, 1);
        }
        // One of a few that are in a plane belongs to them
        let mut plane: Vec<DVec3> =
            (0..25).map(|i| DVec3::new(f64::from(i % 5), f64::from(i / 5), 0.0)).collect();
        plane.push(DVec3::new(2.0, 2.0, 3.5));
        assert!(outline(&[&plane]).points.contains(&plane[25].as_vec3()));
    }

    #[test]
    fn spray_that_is_near_is_not_cut_off() {
        let mut points = ball(3000);
        points.extend((0..20).map(|i| DVec3::new(0.0, 0.0, 1.0 + 0.04 * f64::from(i))));
        let top = |outline: &Outline| outline.points.iter().map(|p| p.z).fold(0.0, f32::max);
        let near = outline(&[&points]);
        assert!((top(&near) - 1.76).abs() < 1e-6);
        assert_eq!(near.outliers, 0);
        points.push(DVec3::new(0.0, 0.0, 4.0));
        let far = outline(&[&points]);
        assert!(top(&far) < 1.8);
        assert!((1..=20).contains(&far.outliers), "{}", far.outliers);
    }

    #[test]
    fn fliers_of_some_frames_are_left_out_of_a_share_of_all() {
        // A heap in ten frames; in one of them, 4 % of its particles fly far above it
        let heap = ball(400);
        let mut flying = heap.clone();
        for point in &mut flying[..16] {
            point.z += 12.0;
        }
        let outline = |fit| {
            let mut outermost = Outermost::default();
            for frame in 0..10 {
                let points = if frame == 4 { &flying } else { &heap };
                outermost.add(&Positions::F64(points.clone()), points.len());
            }
            outermost.outline(fit, DVec3::ZERO).unwrap()
        };
        let highest = |outline: &Outline| {
            let heights = outline.points.iter().map(|p| p.z);
            heights.fold(f32::NEG_INFINITY, f32::max)
        };
        assert!(highest(&outline(Fit::All)) > 11.0);
        let most = outline(Fit::Share(0.99));
        assert!(highest(&most) <= 1.0, "{}", highest(&most));
        assert_eq!(most.outliers, 16);
        // Nothing of a solid body is left out
        let mut outermost = Outermost::default();
        outermost.add(&Positions::F64(heap.clone()), heap.len());
        assert_eq!(outermost.outline(Fit::Share(0.99), DVec3::ZERO).unwrap().outliers, 0);
    }

    #[test]
    fn a_share_of_fliers_leaves_something_to_see() {
        let mut all = ball(400);
        for (index, point) in (0_u32..).zip(all.iter_mut().step_by(20)) {
            *point *= 1e5 * f64::from(index + 1);
        }
        let outline = outline(&[&all]);
        assert!(outline.points.iter().all(|p| p.length() < 2.0), "{outline:?}");
        assert_eq!(outline.outliers, 20);
        // A second body, which is not so far, belongs to the picture
        let mut two = ball(400);
        for point in two.iter_mut().step_by(20) {
            point.x += 20.0;
        }
        assert!(doubles(&self::outline(&[&two])).iter().any(|p| p.x > 19.0));
    }

    #[test]
    fn no_particles_have_no_outline() {
        let mut outermost = Outermost::default();
        outermost.add(&Positions::F64(vec![DVec3::NAN]), 1);
        assert_eq!(outermost.outline(Fit::All, DVec3::ZERO), None);
        assert_eq!(Outermost::default().outline(Fit::Share(0.99), DVec3::ZERO), None);
    }
}
