//! The lattice of a periodic cell: its images, and which image of a particle is the nearest one.

use glam::{DMat3, DVec3, Vec3};

use crate::SimulationCell;

/// The edges along which a cell repeats.
pub struct Lattice {
    /// The edges.
    edges: [DVec3; 3],
    /// The product with a way is its length along each edge, in edges; 0 along edges that do not repeat.
    fractions: [DVec3; 3],
}

impl Lattice {
    /// The lattice of `cell`.
    pub fn new(cell: &SimulationCell) -> Self {
        let [a, b, c] = cell.vectors;
        let inverse = cell.fractions().unwrap_or(DMat3::from_cols(a, b, c).transpose());
        let of_edge = |edge: usize| {
            let row = inverse.row(edge);
            // In a flat cell, edges are assumed to be perpendicular
            let scale = match row.dot(cell.vectors[edge]) {
                0.0 => 0.0,
                length => length.recip(),
            };
            if cell.periodic[edge] { scale * row } else { DVec3::ZERO }
        };
        Self { edges: cell.vectors, fractions: [0, 1, 2].map(of_edge) }
    }

    /// What must be subtracted from the way to a particle for the way to its nearest image; None if it is the nearest
    /// one itself. A way of exactly half an edge is not changed.
    pub fn image(&self, way: Vec3) -> Option<Vec3> {
        let edges = self.edges.into_iter().zip(self.fractions);
        let offset: DVec3 = edges
            .map(|(edge, fraction)| {
                let along = way.as_dvec3().dot(fraction);
                // Half an edge rounds to none
                along.signum() * (along.abs() - 0.5).ceil().max(0.0) * edge
            })
            .sum();
        (offset != DVec3::ZERO).then(|| offset.as_vec3())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_of_more_than_half_an_edge_are_to_images() {
        let lattice = |vectors: [[f64; 3]; 3], periodic| {
            let cell =
                SimulationCell::new(DVec3::ZERO, vectors.map(DVec3::from_array), periodic).unwrap();
            Lattice::new(&cell)
        };
        let image = |lattice: &Lattice, way: [f32; 3]| {
            let image = lattice.image(Vec3::from_array(way));
            image.map(|offset| offset.to_array())
        };
        let tilted = [[10.0, 0.0, 0.0], [4.0, 8.0, 0.0], [0.0, 0.0, 6.0]];
        let all = lattice(tilted, [true; 3]);
        assert_eq!(image(&all, [4.9, 0.0, 0.0]), None);
        assert_eq!(image(&all, [5.0, 0.0, 0.0]), None);
        assert_eq!(image(&all, [-5.1, 0.0, 0.0]), Some([-10.0, 0.0, 0.0]));
        assert_eq!(image(&all, [24.0, 0.0, 0.0]), Some([20.0, 0.0, 0.0]));
        // Along the tilted edge, by 0.45 and 0.55 of it
        assert_eq!(image(&all, [1.8, 3.6, 0.0]), None);
        assert_eq!(image(&all, [2.2, 4.4, 0.0]), Some([4.0, 8.0, 0.0]));
        assert_eq!(image(&all, [0.0, 0.0, 2.9]), None);
        assert_eq!(image(&all, [0.0, 0.0, -3.1]), Some([0.0, 0.0, -6.0]));
        let some = lattice(tilted, [false, true, true]);
        assert_eq!(image(&some, [9.0, 0.0, 0.0]), None);
        let flat = [[10.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0; 3]];
        let flat = lattice(flat, [true; 3]);
        assert_eq!(image(&flat, [4.9, 3.9, 100.0]), None);
        assert_eq!(image(&flat, [0.0, 4.1, 0.0]), Some([0.0, 8.0, 0.0]));
    }
}
