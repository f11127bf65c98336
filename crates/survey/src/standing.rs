//! Whether particles stand on a floor.

use glam::DVec3;

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

#[cfg(test)]
mod tests {
    use super::*;

    /// The points of a lattice with this number of layers on each side that are `inside`.
    fn lattice(layers: i32, inside: impl Fn(DVec3) -> bool) -> Vec<DVec3> {
        let all = (0..layers.pow(3)).map(|i| [i % layers, i / layers % layers, i / layers.pow(2)]);
        let points = all.map(|at| DVec3::from_array(at.map(|i| f64::from(2 * i - layers + 1))));
        points.filter(|p| inside(*p)).collect()
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
