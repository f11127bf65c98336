//! The interval of a ray inside a rod.
//!
//! A rod is the part of a cone between two planes, and with round caps the spheres around its ends. The cone of a rod
//! with round caps touches both spheres. A ray is inside a half of a double cone between the roots of a quadratic
//! equation, or beyond one of them; see Eberly, "Intersection of a Line and a Cone" (2014). With flat caps, the
//! interval of the rod is the intersection of those of the cone and the planes; with round ones, it reaches from the
//! first to the last of the intervals of the parts, since the rod is convex.

use glam::DVec3;

use super::{Caps, Rod, double};

/// A point where a ray crosses the surface of a rod.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// Distance along the ray; -infinity or infinity where an interval has no end.
    pub(super) t: f64,
    face: Face,
}

/// A part of the surface of a rod. Its normal is computed only at the nearest crossing of a ray.
#[derive(Debug, Clone, Copy)]
enum Face {
    /// The cone.
    Side,
    /// The disc at an end.
    Disc(usize),
    /// The sphere around an end.
    Ball(usize),
}

/// Where a ray enters a body and where it leaves it.
pub(super) type Interval = [Crossing; 2];

/// A rod in the form that the test needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    ends: [DVec3; 2],
    radii: [f64; 2],
    caps: Caps,
    /// The part between the caps; None if one sphere contains the other, or there is no length.
    side: Option<Frustum>,
}

/// A part of a cone.
#[derive(Debug, Clone, Copy)]
struct Frustum {
    start: DVec3,
    /// Unit vector from its start to its end.
    axis: DVec3,
    length: f64,
    /// Radius at its start.
    radius: f64,
    /// Increase of the radius per length.
    slope: f64,
}

impl Body {
    pub(super) fn new(rod: &Rod, caps: Caps) -> Self {
        let (ends, radii) = (rod.ends.map(double), rod.radii.map(f64::from));
        Self { ends, radii, caps, side: Frustum::new(ends, radii, caps) }
    }

    /// Lowest and highest corner of a box around the rod.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        let axis = (self.ends[1] - self.ends[0]).normalize_or_zero();
        let reach = |end: usize| match self.caps {
            Caps::Round => DVec3::splat(self.radii[end]),
            // The extent of a disc across its axis
            Caps::Open | Caps::Flat => {
                let across = (DVec3::ONE - axis * axis).max(DVec3::ZERO);
                self.radii[end] * DVec3::new(across.x.sqrt(), across.y.sqrt(), across.z.sqrt())
            }
        };
        let [a, b] = [0, 1].map(|end| [self.ends[end] - reach(end), self.ends[end] + reach(end)]);
        [a[0].min(b[0]), a[1].max(b[1])]
    }

    /// The end that `point` is nearer to, 0 or 1.
    pub(super) fn half_of(&self, point: DVec3) -> usize {
        let middle = 0.5 * (self.ends[0] + self.ends[1]);
        usize::from((point - middle).dot(self.ends[1] - self.ends[0]) > 0.0)
    }

    /// The crossings of a ray with the surface, in the order of distance.
    pub(super) fn crossings(&self, origin: DVec3, direction: DVec3) -> [Option<Crossing>; 2] {
        let (line, start) = self.line(origin, direction);
        let found = match self.caps {
            Caps::Open => self.open(&line),
            Caps::Flat => self.flat(&line),
            Caps::Round => self.round(&line).map_or([None; 2], |found| found.map(Some)),
        };
        found.map(|crossing| {
            let crossing = crossing.filter(|crossing| crossing.t.is_finite())?;
            Some(Crossing { t: crossing.t + start, ..crossing })
        })
    }

    /// The outward unit normal at a crossing of the ray.
    pub(super) fn normal(&self, origin: DVec3, direction: DVec3, crossing: &Crossing) -> DVec3 {
        let (line, start) = self.line(origin, direction);
        let t = crossing.t - start;
        match (crossing.face, &self.side) {
            (Face::Side, Some(side)) => side.normal(&line, t),
            (Face::Disc(0), Some(side)) => -side.axis,
            (Face::Disc(_), Some(side)) => side.axis,
            (Face::Ball(end), _) => {
                (line.origin + t * direction - self.ends[end]) / self.radii[end]
            }
            // Only the frustum has sides and discs
            (Face::Side | Face::Disc(_), None) => DVec3::ZERO,
        }
    }

    /// The line of a ray, from the point closest to the rod, so that no digits are lost far from it; and the distance
    /// of that point along the ray.
    fn line(&self, origin: DVec3, direction: DVec3) -> (Line, f64) {
        let center = 0.5 * (self.ends[0] + self.ends[1]);
        let start = (center - origin).dot(direction) / direction.length_squared();
        (Line { origin: origin + start * direction, direction }, start)
    }

    fn open(&self, line: &Line) -> [Option<Crossing>; 2] {
        let Some(side) = &self.side else {
            return [None; 2];
        };
        let (Some(cone), Some(slab)) = (side.cone(line), side.slab(line)) else {
            return [None; 2];
        };
        let is_between = |crossing: &Crossing| crossing.t >= slab[0].t && crossing.t <= slab[1].t;
        cone.map(|crossing| Some(crossing).filter(is_between))
    }

    fn flat(&self, line: &Line) -> [Option<Crossing>; 2] {
        let found = self.side.as_ref().and_then(|side| side.interval(line));
        found.map_or([None; 2], |found| found.map(Some))
    }

    fn round(&self, line: &Line) -> Option<Interval> {
        let sphere = |end: usize| {
            let [enter, leave] = sphere(line, self.ends[end], self.radii[end])?;
            Some([enter, leave].map(|t| Crossing { t, face: Face::Ball(end) }))
        };
        let side = self.side.as_ref().and_then(|side| side.interval(line));
        let parts = [sphere(0), sphere(1), side].into_iter().flatten();
        parts.reduce(|a, b| [nearer(a[0], b[0]), farther(a[1], b[1])])
    }
}

/// A line in space.
struct Line {
    origin: DVec3,
    direction: DVec3,
}

fn nearer(a: Crossing, b: Crossing) -> Crossing {
    if b.t < a.t { b } else { a }
}

fn farther(a: Crossing, b: Crossing) -> Crossing {
    if b.t > a.t { b } else { a }
}

/// The distances between which a line is inside a sphere.
fn sphere(line: &Line, center: DVec3, radius: f64) -> Option<[f64; 2]> {
    let offset = line.origin - center;
    let direction = line.direction;
    let along = -offset.dot(direction) / direction.length_squared();
    let across = offset + along * direction;
    let half = (radius * radius - across.length_squared()) / direction.length_squared();
    if radius <= 0.0 || half < 0.0 {
        return None;
    }
    let half = half.sqrt();
    Some([along - half, along + half])
}

impl Frustum {
    fn new(ends: [DVec3; 2], radii: [f64; 2], caps: Caps) -> Option<Self> {
        let across = ends[1] - ends[0];
        let length = across.length();
        let axis = across / length;
        if length <= 0.0 || !axis.is_finite() {
            return None;
        }
        // With flat ends, the cone is between the ends themselves
        let [start, end] = radii;
        if caps != Caps::Round {
            return Some(Self {
                start: ends[0],
                axis,
                length,
                radius: start,
                slope: (end - start) / length,
            });
        }
        // The circles where the cone touches the spheres
        let sine = (start - end) / length;
        if sine.abs() >= 1.0 {
            return None;
        }
        let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
        Some(Self {
            start: ends[0] + sine * start * axis,
            axis,
            length: length - sine * (start - end),
            radius: cosine * start,
            slope: -sine / cosine,
        })
    }

    /// The parts of a line along the axis, of its origin and its direction, and the parts across.
    fn along_and_across(&self, line: &Line) -> ([f64; 2], [DVec3; 2]) {
        let offset = line.origin - self.start;
        let (height, rise) = (offset.dot(self.axis), line.direction.dot(self.axis));
        ([height, rise], [offset - height * self.axis, line.direction - rise * self.axis])
    }

    /// The outward unit normal of the cone at a point of a line.
    fn normal(&self, line: &Line, t: f64) -> DVec3 {
        let (_, [across, drift]) = self.along_and_across(line);
        let out = (across + t * drift).normalize_or_zero();
        (out - self.slope * self.axis).normalize_or(self.axis)
    }

    /// The interval between the planes of its ends and inside its cone.
    fn interval(&self, line: &Line) -> Option<Interval> {
        let (cone, slab) = (self.cone(line)?, self.slab(line)?);
        let found = [farther(cone[0], slab[0]), nearer(cone[1], slab[1])];
        (found[0].t <= found[1].t).then_some(found)
    }

    /// The interval between the planes of its ends.
    fn slab(&self, line: &Line) -> Option<Interval> {
        let height = (line.origin - self.start).dot(self.axis);
        let rise = line.direction.dot(self.axis);
        let bottom = |t| Crossing { t, face: Face::Disc(0) };
        let top = |t| Crossing { t, face: Face::Disc(1) };
        if rise == 0.0 {
            let is_inside = (0.0..=self.length).contains(&height);
            return is_inside.then(|| [bottom(f64::NEG_INFINITY), top(f64::INFINITY)]);
        }
        let [low, high] = [-height / rise, (self.length - height) / rise];
        Some(if rise > 0.0 { [bottom(low), top(high)] } else { [top(high), bottom(low)] })
    }

    /// The interval inside the double cone that contains the frustum, where it may be between the planes of the ends.
    fn cone(&self, line: &Line) -> Option<Interval> {
        let ([height, rise], [across, drift]) = self.along_and_across(line);
        // The squared distance from the axis minus the squared radius: a t^2 + 2 b t + c
        let (radius, growth) = (self.radius + self.slope * height, self.slope * rise);
        let a = drift.length_squared() - growth * growth;
        let b = across.dot(drift) - radius * growth;
        let c = across.length_squared() - radius * radius;
        let crossing = |t| Crossing { t, face: Face::Side };
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        // A line along the axis of a cylinder never leaves it
        if a == 0.0 && b == 0.0 {
            return (c <= 0.0).then(|| [crossing(f64::NEG_INFINITY), crossing(f64::INFINITY)]);
        }
        // The roots without cancellation
        let q = -(b + discriminant.sqrt().copysign(b));
        let roots = match (a == 0.0, q == 0.0) {
            (true, _) => [c / q, c / q],
            (false, true) => [0.0, 0.0],
            (false, false) => [q / a, c / q],
        };
        let [first, last] = [roots[0].min(roots[1]), roots[0].max(roots[1])];
        if a > 0.0 {
            // Both roots are on one side of the apex; the planes of the ends exclude the other side
            return Some([crossing(first), crossing(last)]);
        }
        // A line steeper than the cone is inside before its first crossing on one side, and behind its last one on
        // the other
        Some(if growth > 0.0 {
            [crossing(last), crossing(f64::INFINITY)]
        } else {
            [crossing(f64::NEG_INFINITY), crossing(first)]
        })
    }
}
