//! Arrows of two rods: a cylinder with a cone as its head.

use glam::Vec3;

use super::Rod;

/// Radius of the head, in radii of the shaft.
const HEAD_RADIUS: f32 = 2.4;

/// Length of the head, in radii of the shaft.
const HEAD_LENGTH: f32 = 6.0;

/// Least length of an arrow in lengths of its head. Shorter ones are thinner in proportion, so that they are arrows too.
const MIN_LENGTH: f32 = 1.5;

/// The point of an arrow that is at its particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Its start.
    Tail,
    /// Its middle.
    Center,
}

/// An arrow along `vector` at `point`, with a shaft of `radius`; for rods with [flat caps](super::Caps::Flat). Both rods
/// have the colour `color` (see [`Rod::particles`]). None if the vector is zero.
pub fn arrow(
    point: Vec3,
    vector: Vec3,
    (radius, anchor): (f32, Anchor),
    color: u32,
) -> Option<[Rod; 2]> {
    let length = vector.length();
    let axis = vector.try_normalize()?;
    let tail = match anchor {
        Anchor::Tail => point,
        Anchor::Center => point - 0.5 * vector,
    };
    let radius = radius.min(length / (MIN_LENGTH * HEAD_LENGTH));
    let neck = tail + (length - HEAD_LENGTH * radius) * axis;
    let rod = |ends, radii| Rod { ends, radii, particles: [color; 2] };
    Some([rod([tail, neck], [radius; 2]), rod([neck, tail + vector], [HEAD_RADIUS * radius, 0.0])])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_reach_from_tail_to_tip() {
        let (point, vector) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.0, 8.0));
        let [shaft, head] = arrow(point, vector, (0.5, Anchor::Tail), 7).unwrap();
        assert_eq!(shaft.ends, [point, Vec3::new(1.0, 2.0, 8.0)]);
        assert_eq!(shaft.radii, [0.5, 0.5]);
        assert_eq!(head.ends, [shaft.ends[1], point + vector]);
        assert_eq!(head.radii, [1.2, 0.0]);
        assert_eq!([shaft.particles, head.particles], [[7; 2]; 2]);
        let [shaft, head] = arrow(point, vector, (0.5, Anchor::Center), 0).unwrap();
        assert_eq!(shaft.ends[0], point - 0.5 * vector);
        assert_eq!(head.ends[1], point + 0.5 * vector);
    }

    #[test]
    fn short_arrows_keep_their_shape_and_zero_has_none() {
        let short = |length: f32| arrow(Vec3::ZERO, length * Vec3::X, (1.0, Anchor::Tail), 0);
        let [shaft, head] = short(0.9).unwrap();
        assert!((shaft.radii[0] - 0.1).abs() < 1e-6);
        assert!((shaft.ends[1].x - 0.3).abs() < 1e-6);
        assert!((head.radii[0] - 0.24).abs() < 1e-6);
        assert_eq!(head.ends[1], Vec3::new(0.9, 0.0, 0.0));
        assert_eq!(short(0.0), None);
    }
}
