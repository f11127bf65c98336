//! The cube from -1 to 1.

use glam::DVec3;

use super::Hit;

/// A plane that bounds an interval of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub(super) t: f64,
    /// Outward normal of the plane.
    pub(super) normal: DVec3,
}

/// The interval of a ray between the planes of the `axes` at -1 and 1; None if it is empty.
pub(super) fn interval(origin: DVec3, direction: DVec3, axes: &[usize]) -> Option<[End; 2]> {
    let mut enter = End { t: f64::NEG_INFINITY, normal: DVec3::ZERO };
    let mut leave = End { t: f64::INFINITY, normal: DVec3::ZERO };
    for &axis in axes {
        if direction[axis] == 0.0 {
            if origin[axis].abs() > 1.0 {
                return None;
            }
            continue;
        }
        let side = direction[axis].signum();
        let [near, far] = [-side, side].map(|plane| (plane - origin[axis]) / direction[axis]);
        let normal = DVec3::AXES[axis] * side;
        if near > enter.t {
            enter = End { t: near, normal: -normal };
        }
        if far < leave.t {
            leave = End { t: far, normal };
        }
    }
    (enter.t <= leave.t).then_some([enter, leave])
}

/// Both ends of a ray in the cube.
pub(super) fn cuboid(origin: DVec3, direction: DVec3) -> Option<[Hit; 2]> {
    let ends = interval(origin, direction, &[0, 1, 2])?;
    Some(ends.map(|end| Hit::new(end.t, end.normal)))
}
