//! The simulation cell: the parallelepiped in which a molecular simulation takes place.

use glam::DVec3;
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
        let cell = Self {
            origin,
            vectors,
            periodic,
        };
        let is_finite = cell.corners().iter().all(|corner| corner.is_finite());
        (is_finite && vectors != [DVec3::ZERO; 3]).then_some(cell)
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
    fn a_tilted_cell_has_eight_corners_and_twelve_edges() {
        let [a, b, c] = [
            DVec3::new(2.0, 0.0, 0.0),
            DVec3::new(1.0, 3.0, 0.0),
            DVec3::new(0.5, 0.25, 4.0),
        ];
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
        assert_eq!(
            SimulationCell::new(origin, [DVec3::ZERO; 3], [true; 3]),
            None
        );
        assert_eq!(
            SimulationCell::new(origin, [a, DVec3::NAN, c], [true; 3]),
            None
        );
    }
}
