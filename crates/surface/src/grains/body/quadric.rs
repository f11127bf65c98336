//! Spheres, cylinders and capsules: the interval of a ray inside a quadric, between planes.

use glam::{DVec2, DVec3};

use super::{Hit, slab};

/// The roots of `a t^2 + 2 b t + c`, ascending; None if there are none.
fn roots(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - a * c;
    // Written so that NaN and constants have none
    if !(discriminant >= 0.0 && a > 0.0) {
        return None;
    }
    // Without cancellation
    let q = -(b + discriminant.sqrt().copysign(b));
    if q == 0.0 {
        return Some([0.0, 0.0]);
    }
    let (x, y) = (q / a, c / q);
    Some([x.min(y), x.max(y)])
}

/// Both ends of a ray in the unit sphere.
pub(super) fn sphere(origin: DVec3, direction: DVec3) -> Option<[Hit; 2]> {
    let ends = sphere_at(origin, direction)?;
    Some(ends.map(|t| Hit::new(t, origin + t * direction)))
}

/// The interval of a ray in the unit sphere.
fn sphere_at(origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    roots(direction.length_squared(), origin.dot(direction), origin.length_squared() - 1.0)
}

/// The interval of a ray in the infinite cylinder around z; infinite for a ray along z inside it.
fn tube(origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let (o, d): (DVec2, DVec2) = (origin.truncate(), direction.truncate());
    let c = o.length_squared() - 1.0;
    if d == DVec2::ZERO {
        return (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    roots(d.length_squared(), o.dot(d), c)
}

/// Both ends of a ray in the cylinder of radius 1 from -1 to 1.
pub(super) fn cylinder(origin: DVec3, direction: DVec3) -> Option<[Hit; 2]> {
    let [start, end] = tube(origin, direction)?;
    let [bottom, top] = slab::interval(origin, direction, &[2])?;
    let side = |t: f64| Hit::new(t, (origin + t * direction).with_z(0.0));
    let cap = |end: slab::End| Hit::new(end.t, end.normal);
    let enter = if bottom.t >= start { cap(bottom) } else { side(start) };
    let leave = if top.t <= end { cap(top) } else { side(end) };
    (enter.t <= leave.t).then_some([enter, leave])
}

/// Both ends of a ray in the capsule of radius 1 around the z axis from `-half` to `half`: the first and the last of the
/// intervals in both spheres and in the cylinder between them, since it is convex.
pub(super) fn capsule(origin: DVec3, direction: DVec3, half: f64) -> Option<[Hit; 2]> {
    let between = |[start, end]: [f64; 2]| {
        // The part between the centres of the spheres
        let planes = if direction.z == 0.0 {
            (origin.z.abs() <= half).then_some([f64::NEG_INFINITY, f64::INFINITY])
        } else {
            let ends = [-half, half].map(|z| (z - origin.z) / direction.z);
            Some([ends[0].min(ends[1]), ends[0].max(ends[1])])
        };
        let range = planes.map(|[low, high]| [start.max(low), end.min(high)]);
        range.filter(|[start, end]| start <= end)
    };
    let parts = [
        sphere_at(origin - DVec3::Z * half, direction),
        sphere_at(origin + DVec3::Z * half, direction),
        tube(origin, direction).and_then(between),
    ];
    let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let ends = parts.into_iter().flatten().reduce(join)?;
    Some(ends.map(|t| {
        let point = origin + t * direction;
        Hit::new(t, point - DVec3::Z * point.z.clamp(-half, half))
    }))
}
