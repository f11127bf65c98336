//! The simulation cell: the parallelepiped in which a molecular simulation takes place.

use glam::{DMat3, DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A corner, and the three edges that meet there; not necessarily at right angles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SimulationCell {
    /// The corner where all edges begin, world units.
    pub origin: DVec3,
    /// The edges.
    pub vectors: [DVec3; 3],
    /// Whether the cell repeats along each edge.
    pub periodic: [bool; 3],
}

impl SimulationCell {
    /// A cell; None if a number is not finite, or all edges have no length.
    pub fn new(origin: DVec3, vectors: [DVec3; 3], periodic: [bool; 3]) -> Option<Self> {
        let cell = Self { origin, vectors, periodic };
        let is_finite = cell.corners().iter().all(|corner| corner.is_finite());
        (is_finite && vectors != [DVec3::ZERO; 3]).then_some(cell)
    }

    /// A periodic cell with a corner at the origin, from the lengths of its edges a, b, c and the cosines of the angles
    /// alpha (between b and c), beta (a and c) and gamma (a and b). Edge a is along x, edge b in the plane of x and y, as
    /// in the International Tables for Crystallography, volume B, 3.3. None if a length is not above 0, or there is no
    /// body with these angles.
    pub fn from_cosines(lengths: [f64; 3], cosines: [f64; 3]) -> Option<Self> {
        let [a, b, c] = lengths;
        let [alpha, beta, gamma] = cosines;
        let sine = (1.0 - gamma * gamma).sqrt();
        let y = (alpha - beta * gamma) / sine;
        let z = (1.0 - beta * beta - y * y).sqrt();
        // NaN where there is no such body
        let is_body = lengths.iter().all(|length| *length > 0.0) && sine > 0.0 && z > 0.0;
        let vectors =
            [DVec3::new(a, 0.0, 0.0), b * DVec3::new(gamma, sine, 0.0), c * DVec3::new(beta, y, z)];
        Self::new(DVec3::ZERO, vectors, [true; 3]).filter(|_| is_body)
    }

    /// Same as [`Self::from_cosines`], with the angles in degrees.
    pub fn from_angles(lengths: [f64; 3], angles: [f64; 3]) -> Option<Self> {
        let cosine = |angle: f64| match angle {
            90.0 => 0.0,
            _ => libm::cos(angle.to_radians()),
        };
        let is_angle = |angle: &f64| *angle > 0.0 && *angle < 180.0;
        let angles = Some(angles).filter(|angles| angles.iter().all(is_angle))?;
        Self::from_cosines(lengths, angles.map(cosine))
    }

    /// A periodic cell with a corner at the origin and these nine components of its edges; none if all are zero.
    pub fn from_components(components: [f64; 9]) -> Option<Self> {
        let [a, b, c] = [0, 3, 6].map(|start| DVec3::from_slice(&components[start..start + 3]));
        Self::new(DVec3::ZERO, [a, b, c], [true; 3])
    }

    /// The eight corners; bit `i` of the index says whether a corner is at the end of edge `i`.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let ends = (0..3).filter(|edge| corner >> edge & 1 == 1);
            self.origin + ends.map(|edge| self.vectors[edge]).sum::<DVec3>()
        })
    }

    /// The corners at both ends of each of the twelve edges.
    pub fn edges(&self) -> [[DVec3; 2]; 12] {
        let corners = self.corners();
        std::array::from_fn(|number| {
            let (edge, rest) = (number / 4, number % 4);
            // The corner has bit `edge` 0, and the bits of `rest` around it
            let low = rest & ((1 << edge) - 1);
            let start = (rest - low) << 1 | low;
            [corners[start], corners[start | 1 << edge]]
        })
    }

    /// The matrix from places relative to the corner to fractions of the edges; none without a volume.
    pub fn fractions(&self) -> Option<DMat3> {
        let [a, b, c] = self.vectors;
        let inverse = DMat3::from_cols(a, b, c).inverse();
        inverse.is_finite().then_some(inverse)
    }

    /// How many edges of the cell are in a `way` between two particles, along each edge along which it repeats.
    /// `inverse` is that of [`Self::fractions`].
    pub(super) fn edges_in(&self, inverse: DMat3, way: DVec3) -> [f64; 3] {
        let numbers = (inverse * way).round().to_array();
        std::array::from_fn(|edge| if self.periodic[edge] { numbers[edge] } else { 0.0 })
    }

    /// Where the images of the cell next to it are, without itself.
    pub fn images_around(&self) -> Vec<Vec3> {
        let steps = |edge: usize| {
            if self.periodic[edge] && self.vectors[edge].length_squared() > 0.0 {
                -1..=1
            } else {
                0..=0
            }
        };
        let mut images = Vec::new();
        for a in steps(0) {
            for b in steps(1) {
                for c in steps(2) {
                    if [a, b, c] != [0; 3] {
                        let edges = self.vectors.into_iter().zip([a, b, c].map(f64::from));
                        let offset: DVec3 = edges.map(|(edge, number)| number * edge).sum();
                        images.push(offset.as_vec3());
                    }
                }
            }
        }
        images
    }

    /// Length of the longest diagonal.
    pub fn diagonal(&self) -> f64 {
        let corners = self.corners();
        let across = (0..4).map(|corner| corners[corner].distance(corners[7 - corner]));
        across.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_follow_from_lengths_and_angles() {
        // A hexagonal cell: b = 4 (cos 120, sin 120)
        let cell = SimulationCell::from_angles([3.0, 4.0, 5.0], [90.0, 90.0, 120.0]).unwrap();
        let expected = [
            DVec3::new(3.0, 0.0, 0.0),
            DVec3::new(-2.0, 4.0 * 0.75_f64.sqrt(), 0.0),
            DVec3::new(0.0, 0.0, 5.0),
        ];
        for (found, expected) in cell.vectors.into_iter().zip(expected) {
            assert!(found.distance(expected) < 1e-12, "{found} {expected}");
        }
        // A rhombohedral one: the primitive cell of a face-centred cube, whose edges have equal angles of 60 degrees
        let cell = SimulationCell::from_cosines([2.0; 3], [0.5; 3]).unwrap();
        let [a, b, c] = cell.vectors;
        assert_eq!(a, DVec3::new(2.0, 0.0, 0.0));
        for (one, other) in [(a, b), (a, c), (b, c)] {
            assert!((one.dot(other) - 2.0).abs() < 1e-12);
            assert!((one.length() - 2.0).abs() < 1e-12);
        }
        assert!((a.cross(b).dot(c) - 4.0 * 2.0_f64.sqrt()).abs() < 1e-12);
        let lengths = [3.0, 4.0, 5.0];
        for angles in [
            [90.0, 90.0, 0.0],
            [90.0, 180.0, 90.0],
            [10.0, 20.0, 90.0],
            [f64::NAN, 90.0, 90.0],
            [-90.0, 90.0, 90.0],
        ] {
            assert_eq!(SimulationCell::from_angles(lengths, angles), None, "{angles:?}");
        }
        for lengths in [[0.0, 4.0, 5.0], [3.0, -4.0, 5.0], [3.0, 4.0, f64::INFINITY]] {
            assert_eq!(SimulationCell::from_angles(lengths, [90.0; 3]), None);
        }
    }

    #[test]
    fn a_tilted_cell_has_eight_corners_and_twelve_edges() {
        let [a, b, c] =
            [DVec3::new(2.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0), DVec3::new(0.5, 0.25, 4.0)];
        let origin = DVec3::new(-1.0, 5.0, 7.0);
        let cell = SimulationCell::new(origin, [a, b, c], [true; 3]).unwrap();
        let corners = cell.corners();
        assert_eq!(corners[0], origin);
        assert_eq!(corners[5], origin + a + c);
        assert_eq!(corners[7], origin + a + b + c);
        // Each corner is an end of three edges, and four edges have each direction
        let edges = cell.edges();
        for corner in corners {
            let ends = edges.iter().flatten().filter(|end| **end == corner);
            assert_eq!(ends.count(), 3);
        }
        for vector in [a, b, c] {
            let along = edges.iter().filter(|[start, end]| *end - *start == vector);
            assert_eq!(along.count(), 4);
        }
        assert_eq!(cell.diagonal(), (a + b + c).length());
        assert_eq!(SimulationCell::new(origin, [DVec3::ZERO; 3], [true; 3]), None);
        assert_eq!(SimulationCell::new(origin, [a, DVec3::NAN, c], [true; 3]), None);
    }
}
