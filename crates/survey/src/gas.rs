//! Whether particles fill a box as a gas or a liquid without gravity does: nothing says that they stand on a floor.

use glam::DVec3;

use super::standing::standing;

/// Fewest particles that say something.
const MIN_COUNT: usize = 100;

/// The smallest measure of [`standing`] at each of the six sides of a box: 0.5 for particles at random places, 1 for a
/// lattice.
const FLAT_SIDE: f64 = 0.3;

/// Bounds of the part of the kinetic energy along an axis: a third in thermal motion.
const ENERGY: std::ops::RangeInclusive<f64> = 0.22..=0.45;

/// The largest speed of all particles together, relative to the root mean square, in thermal motion.
const DRIFT: f64 = 0.2;

/// The largest correlation of a component of the velocity with the height, in thermal motion: a fluid that flows or falls
/// has more.
const SHEAR: f64 = 0.3;

/// The largest difference of the sides of a cube, relative to the longest.
const CUBE: f64 = 0.03;

/// How the places of particles are related.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Equal distances, as in a lattice.
    Lattice,
    /// Different distances, as in a liquid.
    Liquid,
    /// None.
    Random,
}

/// Whether `sample`, some of `count` particles, fills a box, and the particles are at random places, move as molecules do,
/// or are a cube of liquid. `velocities` are those of the sample, or none.
pub(super) fn is_gas(sample: &[DVec3], count: usize, velocities: &[DVec3], order: Order) -> bool {
    let is_side_flat = |axis: &DVec3| standing(sample, count, *axis) >= FLAT_SIDE;
    let axes = DVec3::AXES;
    count >= MIN_COUNT
        && (order == Order::Random
            || is_thermal(sample, velocities)
            || (order == Order::Liquid && velocities.is_empty() && is_cube(sample)))
        && axes.iter().all(is_side_flat)
        && axes.iter().all(|axis| is_side_flat(&-*axis))
}

/// Whether all sides of the box of the points are equally long.
fn is_cube(sample: &[DVec3]) -> bool {
    let corners = sample.iter().map(|p| (*p, *p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    corners.is_some_and(|(min, max)| {
        let size = max - min;
        size.min_element() >= (1.0 - CUBE) * size.max_element()
    })
}

/// Whether velocities are alike along all axes and everywhere.
fn is_thermal(sample: &[DVec3], velocities: &[DVec3]) -> bool {
    if velocities.len() < MIN_COUNT || velocities.len() != sample.len() {
        return false;
    }
    // Find the energy and the drift, and how the velocity changes from place to place
    #[expect(clippy::cast_precision_loss, reason = "a sample")]
    let part = 1.0 / velocities.len() as f64;
    let mean = |values: &dyn Fn(usize) -> DVec3| -> DVec3 {
        (0..velocities.len()).map(values).sum::<DVec3>() * part
    };
    let squares = mean(&|i| velocities[i] * velocities[i]);
    let energy = squares.element_sum();
    let drift = mean(&|i| velocities[i]);
    let middle = mean(&|i| sample[i]);
    let spread = mean(&|i| (sample[i] - middle) * (sample[i] - middle));
    let is_uniform = |axis: usize| {
        let along = mean(&|i| velocities[i] * (sample[i][axis] - middle[axis]));
        (along * along).max_element() <= SHEAR * SHEAR * energy / 3.0 * spread[axis]
    };
    // Compare them with those of a gas at rest
    energy > 0.0
        && energy.is_finite()
        && squares.to_array().iter().all(|square| ENERGY.contains(&(square / energy)))
        && drift.length_squared() <= DRIFT * DRIFT * energy
        && (0..3).all(is_uniform)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1.
    fn random() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 23) - 1.0
        }
    }

    fn vectors(count: usize) -> Vec<DVec3> {
        let mut random = random();
        (0..count).map(|_| DVec3::new(random(), random(), random())).collect()
    }

    #[test]
    fn liquids_fill_their_box_and_fluids_under_gravity_do_not() {
        let all = vectors(4000);
        let (places, velocities) = all.split_at(2000);
        assert!(is_gas(places, 2000, velocities, Order::Liquid));
        assert!(is_gas(places, 2000, &[], Order::Random));
        assert!(is_gas(places, 2000, &[], Order::Liquid));
        assert!(!is_gas(places, 2000, &[], Order::Lattice));
        let flat: Vec<DVec3> = places.iter().map(|p| *p * DVec3::new(1.0, 1.0, 0.5)).collect();
        assert!(!is_gas(&flat, 2000, &[], Order::Liquid));
        // A stream, a fluid that falls, and one that turns over
        let stream: Vec<DVec3> = velocities.iter().map(|v| *v + DVec3::X).collect();
        assert!(!is_gas(places, 2000, &stream, Order::Liquid));
        let falling: Vec<DVec3> =
            velocities.iter().map(|v| *v * DVec3::new(1.0, 1.0, 4.0)).collect();
        assert!(!is_gas(places, 2000, &falling, Order::Liquid));
        let rolling: Vec<DVec3> = places.iter().map(|p| p.cross(DVec3::ONE)).collect();
        assert!(!is_gas(places, 2000, &rolling, Order::Liquid));
        // A heap of the same particles, and a ball
        let heap: Vec<DVec3> = places.iter().map(|p| p.with_z(p.z * p.x.abs())).collect();
        assert!(!is_gas(&heap, 2000, velocities, Order::Random));
        let ball: Vec<DVec3> = places.iter().copied().filter(|p| p.length() < 1.0).collect();
        assert!(!is_gas(&ball, ball.len(), &[], Order::Random));
    }
}
