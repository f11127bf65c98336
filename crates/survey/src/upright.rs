//! Which axis points up, where the format does not say: whether particles lie on a plane at one end of an axis, and not at
//! the other.

use glam::DVec3;

use super::standing::standing;

/// Largest measure of [`standing`] that counts: a thin layer on a floor says no more than a heap.
const MAX_STANDING: f64 = 3.0;

/// How much more particles lie at the lower end of an axis than at its upper end if it points up.
const UPRIGHT: f64 = 0.5;

/// The same for axes that seldom point up.
const CLEAR: f64 = 0.8;

/// The largest part of that which another axis may have: walls beside a fluid are on both sides of it.
const OTHER: f64 = 0.25;

/// The smallest mean velocity away from a wall, relative to the root mean square, of a fluid that leaves it.
const LEAVES: f64 = 0.2;

/// The smallest mean velocity downwards of such a fluid, which falls as it leaves. A splash that rises does not.
const FALLS: f64 = 0.1;

/// The axis that points up, if it is not the `usual` one. `sample`: some of `count` particles, with their velocities if they
/// have some.
///
/// Particles lie on a plane at the lower end of the axis that points up. A fluid also leans on the wall that it leaves as
/// it falls.
pub(super) fn up_of(
    sample: &[DVec3],
    count: usize,
    velocities: &[DVec3],
    usual: DVec3,
) -> Option<DVec3> {
    let lies = |axis: DVec3| standing(sample, count, axis).min(MAX_STANDING);
    let upright = |axis: DVec3| lies(axis) - lies(-axis);
    let leaves = |wall: DVec3, floor: DVec3| {
        rise(velocities, wall) > LEAVES && rise(velocities, -floor) > FALLS
    };
    let along_usual = upright(usual);
    // y alone is common enough to follow from a plane that is not very clear, and particles that move. A jet ends in a plane
    let is_at_rest = |axis: DVec3| !velocities.is_empty() && rise(velocities, axis).abs() <= LEAVES;
    let is_up = |axis: &DVec3| {
        let along = upright(*axis);
        let is_clear = match *axis {
            DVec3::Y => along >= UPRIGHT,
            other => along >= CLEAR && is_at_rest(other),
        };
        is_clear && along_usual.abs() <= OTHER * along && !leaves(*axis, usual)
    };
    // Grains in a funnel have a plane above them: nothing says that z points down
    let axes = [DVec3::Y, DVec3::Z, DVec3::X, DVec3::NEG_Y, DVec3::NEG_X];
    let found: Vec<DVec3> = axes.into_iter().filter(|axis| *axis != usual).filter(is_up).collect();
    // Of a floor and a wall, the wall is the one that the particles leave
    let is_floor = |axis: &&DVec3| !found.iter().any(|other| leaves(**axis, *other));
    found.iter().find(is_floor).copied()
}

/// The mean velocity along `up`, relative to the root mean square of all.
fn rise(velocities: &[DVec3], up: DVec3) -> f64 {
    let squares: f64 = velocities.iter().map(|v| v.length_squared()).sum();
    if squares <= 0.0 || !squares.is_finite() {
        return 0.0;
    }
    #[expect(clippy::cast_precision_loss, reason = "a sample")]
    let count = velocities.len() as f64;
    let mean = velocities.iter().map(|v| v.dot(up)).sum::<f64>() / count;
    mean / (squares / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Particles of a lattice with this number along each axis that are `inside`.
    fn lattice(sides: [u32; 3], inside: impl Fn(DVec3) -> bool) -> Vec<DVec3> {
        let [x, y, z] = sides;
        let all = (0..x * y * z).map(|i| [i % x, i / x % y, i / (x * y)]);
        all.map(|at| DVec3::from_array(at.map(f64::from))).filter(|p| inside(*p)).collect()
    }

    fn is_up(points: &[DVec3], velocity: DVec3) -> bool {
        up_of(points, points.len(), &vec![velocity; points.len()], DVec3::Z) == Some(DVec3::Y)
    }

    #[test]
    fn heaps_and_fluids_between_walls_show_the_way_up() {
        // A heap, and a wedge of fluid that leans on the wall at x = 0
        let heap = |p: DVec3| (p.x - 12.0).hypot(p.z - 12.0) < 12.0 - p.y;
        let wedge = |p: DVec3| p.y < 12.0 - 0.5 * p.x;
        let to_z = |points: &[DVec3]| -> Vec<DVec3> {
            points.iter().map(|p| DVec3::new(p.x, p.z, p.y)).collect()
        };
        for shape in [lattice([25, 12, 25], heap), lattice([24, 12, 10], wedge)] {
            assert!(is_up(&shape, DVec3::ZERO) && is_up(&shape, DVec3::Y));
            assert!(!is_up(&to_z(&shape), DVec3::ZERO));
        }
    }

    #[test]
    fn heaps_show_any_way_up() {
        let of = |points: &[DVec3], velocity: DVec3| {
            up_of(points, points.len(), &vec![velocity; points.len()], DVec3::Z)
        };
        let heap = lattice([25, 12, 25], |p| (p.x - 12.0).hypot(p.z - 12.0) < 12.0 - p.y);
        let turned = |turn: fn(DVec3) -> DVec3| heap.iter().map(|p| turn(*p)).collect::<Vec<_>>();
        assert_eq!(of(&turned(|p| DVec3::new(p.y, p.x, p.z)), DVec3::ZERO), Some(DVec3::X));
        assert_eq!(of(&turned(|p| DVec3::new(p.x, -p.y, p.z)), DVec3::ZERO), Some(DVec3::NEG_Y));
        assert_eq!(of(&turned(|p| DVec3::new(p.x, p.z, -p.y)), DVec3::ZERO), None);
        assert_eq!(of(&turned(|p| DVec3::new(p.x, p.z, p.y)), DVec3::ZERO), None);
        // A dam that breaks: the wall that it leaves is not its floor
        let dam = lattice([12, 24, 10], |p| p.x < 12.0 - 0.5 * p.y);
        assert_eq!(of(&dam, DVec3::new(-0.15, 1.0, 0.0)), Some(DVec3::X));
        assert_eq!(of(&dam, DVec3::new(1.0, -0.4, 0.0)), Some(DVec3::Y));
        // A jet along x that becomes denser
        let jet = lattice([24, 10, 10], |p| (p.y - 5.0).hypot(p.z - 5.0) < 0.2 * p.x);
        assert_eq!(of(&jet, DVec3::X), None);
        // It may also be a wave that climbs up a wall
        let wave = lattice([12, 10, 24], |p| p.x < 12.0 - 0.5 * p.z);
        assert_eq!(of(&wave, DVec3::new(-0.4, 0.0, 1.0)), None);
    }

    #[test]
    fn blocks_balls_and_flows_do_not() {
        assert!(!is_up(&lattice([20, 12, 10], |_| true), DVec3::ZERO));
        let ball = lattice([21, 21, 21], |p| p.distance(DVec3::splat(10.0)) < 10.0);
        assert!(!is_up(&ball, DVec3::NEG_Y));
        // Fluid that leaves a wall at y = 0, under gravity along z
        let flow = lattice([10, 24, 8], |p| p.y < 20.0 - 0.8 * p.z || p.y < 3.0);
        assert!(!is_up(&flow, DVec3::new(0.0, 1.0, -0.3)));
        assert!(!is_up(&[], DVec3::ZERO));
    }
}
