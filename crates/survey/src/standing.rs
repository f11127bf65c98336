//! Whether particles stand on a floor.

use glam::DVec3;
use spherule_formats::{Attribute, Positions, sample_indices};

/// Part of the particles at each end that may be below a floor or far above.
const OUTSIDE: usize = 1000;

/// Thickness of the layer on the floor, as a part of the mean distance of layers of a cube of as many particles.
const THICKNESS: f64 = 0.5;

/// How many particles lie on the lowest plane normal to `up`, relative to those that would lie under a cube of `count`
/// particles: 1 for a cube on a floor, more for a heap, and about 0.1 for a ball. `sample`: some of the particles.
pub(super) fn standing(sample: &[DVec3], count: usize, up: DVec3) -> f64 {
    let mut heights: Vec<f64> = sample.iter().map(|p| p.dot(up)).collect();
    heights.sort_unstable_by(f64::total_cmp);
    let outside = heights.len() / OUTSIDE;
    let ends = heights.get(outside).zip(heights.iter().nth_back(outside));
    let Some((low, high)) = ends else { return 0.0 };
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let (layers, all) = (libm::cbrt(count as f64), heights.len() as f64);
    let top = low + (high - low) * THICKNESS / layers;
    #[expect(clippy::cast_precision_loss, reason = "a part of a sample")]
    let part = heights.partition_point(|height| *height <= top) as f64 / all;
    part * layers
}

/// Number of particles whose velocities are examined.
const SAMPLE: usize = 1 << 14;

/// The lowest particles, as a part of all.
const LOWEST: f64 = 0.02;

/// Their mean velocity downwards, relative to the root mean square of all velocities, from which on they fall.
const FALLS: f64 = 0.5;

/// Whether the lowest particles along `up` move down as a whole: they do not stand on a floor yet. `velocity` is a vector
/// in space.
pub(super) fn is_falling(positions: &Positions, velocity: &Attribute, up: DVec3) -> bool {
    let motion = |i: usize| {
        let component = |axis: usize| velocity.data.get_f64(3 * i + axis);
        let velocity = DVec3::new(component(0), component(1), component(2));
        (positions.get(i).dot(up), velocity.dot(up), velocity.length_squared())
    };
    // Sort the particles by height
    let count = positions.len().min(velocity.count());
    let mut all: Vec<(f64, f64, f64)> = sample_indices(count, SAMPLE).map(motion).collect();
    all.retain(|(height, _, square)| height.is_finite() && square.is_finite());
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    // Compare the motion of the lowest with the speed of all
    #[expect(clippy::cast_precision_loss, reason = "a sample")]
    let all_count = all.len() as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of them")]
    let lowest = (LOWEST * all_count).ceil() as usize;
    let squares: f64 = all.iter().map(|(.., square)| square).sum();
    let rise: f64 = all.iter().take(lowest).map(|(_, rise, _)| rise).sum();
    #[expect(clippy::cast_precision_loss, reason = "a part of a sample")]
    let rise = rise / lowest.max(1) as f64;
    squares > 0.0 && rise < -FALLS * (squares / all_count).sqrt()
}

#[cfg(test)]
mod tests {
    use spherule_formats::AttributeData;

    use super::*;

    /// The points of a lattice with this number of layers on each side that are `inside`.
    fn lattice(layers: i32, inside: impl Fn(DVec3) -> bool) -> Vec<DVec3> {
        let all = (0..layers.pow(3)).map(|i| [i % layers, i / layers % layers, i / layers.pow(2)]);
        let points = all.map(|at| DVec3::from_array(at.map(|i| f64::from(2 * i - layers + 1))));
        points.filter(|p| inside(*p)).collect()
    }

    #[test]
    fn jets_fall_and_fluids_on_a_floor_do_not() {
        let points = lattice(8, |_| true);
        let falls = |velocity: fn(DVec3) -> DVec3| {
            let values = points.iter().flat_map(|p| velocity(*p).to_array()).collect();
            let data = AttributeData::F64(values);
            let velocity = Attribute { name: "velocity".to_owned(), components: 3, data };
            is_falling(&Positions::F64(points.clone()), &velocity, DVec3::Z)
        };
        assert!(falls(|_| DVec3::new(0.3, 0.0, -1.0)));
        assert!(!falls(|_| DVec3::ZERO) && !falls(|_| DVec3::Z) && !falls(|_| DVec3::X));
        // A column that collapses on its floor
        assert!(!falls(|p| DVec3::new(1.0, 0.0, -0.1 * (p.z + 7.0))));
    }

    #[test]
    fn cubes_and_heaps_stand_and_balls_do_not() {
        let of = |points: &[DVec3]| standing(points, points.len(), DVec3::Z);
        let cube = lattice(12, |_| true);
        assert!((0.8..1.5).contains(&of(&cube)), "{}", of(&cube));
        let heap = lattice(24, |p| p.truncate().length() < 0.5 * (24.0 - p.z));
        assert!(of(&heap) > 1.0, "{}", of(&heap));
        for layers in [10, 17, 24, 31] {
            let ball = lattice(layers, |p| p.length() <= f64::from(layers));
            assert!(of(&ball) < 0.3, "{layers} layers: {}", of(&ball));
        }
        assert_eq!(of(&[]), 0.0);
    }
}
