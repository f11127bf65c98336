//! Molecules of periodic cells made whole, so that no bond crosses the cell.

use glam::{DMat3, DVec3};

use crate::{Bond, ParseError, RawParticles, SimulationCell};

/// Names of the attributes with the number of cells that a particle has crossed along each edge, as LAMMPS writes them.
const IMAGE_FLAGS: [&str; 3] = ["ix", "iy", "iz"];

/// Moves the particles of `particles` by whole edges of their `cell`: each to the image that is nearest to the particle that
/// it has a bond with, or, without bonds, by the image flags.
///
/// # Errors
/// There are neither bonds nor image flags, or the cell has no volume.
pub(super) fn make_whole(
    particles: &mut RawParticles,
    cell: &SimulationCell,
) -> Result<(), ParseError> {
    let offsets = if particles.bonds.is_empty() {
        by_flags(particles, cell).ok_or_else(|| {
            ParseError::unsupported(
                "neither bonds nor image flags (ix, iy, iz), one of which cell.unwrap needs; --topology gives bonds",
            )
        })?
    } else {
        let inverse = cell.fractions().ok_or_else(|| {
            ParseError::unsupported(
                "the simulation cell has no volume, so that nothing can be unwrapped",
            )
        })?;
        by_bonds(particles, cell, inverse)
    };
    let mut offsets = offsets.into_iter();
    particles.positions.each(|position| position + offsets.next().unwrap_or(DVec3::ZERO));
    Ok(())
}

/// By how far each particle moves by its image flags; None without them.
fn by_flags(particles: &RawParticles, cell: &SimulationCell) -> Option<Vec<DVec3>> {
    let flags = IMAGE_FLAGS.map(|name| {
        let is_flag =
            |a: &&crate::Attribute| a.components == 1 && a.name.eq_ignore_ascii_case(name);
        particles.attributes.iter().find(is_flag)
    });
    let [Some(x), Some(y), Some(z)] = flags else {
        return None;
    };
    let offset = |particle: usize| {
        let numbers = [x, y, z].map(|flag| flag.data.get_f64(particle));
        let edges = cell.vectors.into_iter().zip(numbers);
        edges
            .map(|(edge, number)| if number.is_finite() { number * edge } else { DVec3::ZERO })
            .sum()
    };
    Some((0..particles.positions.len()).map(offset).collect())
}

/// By how far each particle moves to be near those that it has bonds with. Of a molecule, the particle that comes first
/// stays where it is.
fn by_bonds(particles: &RawParticles, cell: &SimulationCell, inverse: DMat3) -> Vec<DVec3> {
    let count = particles.positions.len();
    let neighbours = Neighbours::new(count, &particles.bonds);
    let mut offsets = vec![DVec3::ZERO; count];
    let mut is_placed = vec![false; count];
    let mut open = Vec::new();
    for first in 0..count {
        if std::mem::replace(&mut is_placed[first], true) {
            continue;
        }
        // Place each particle next to the one that it was found by
        open.push(first);
        while let Some(placed) = open.pop() {
            let from = particles.positions.get(placed) + offsets[placed];
            for other in neighbours.of(placed) {
                if std::mem::replace(&mut is_placed[other], true) {
                    continue;
                }
                let way = particles.positions.get(other) - from;
                offsets[other] = -nearest_edges(cell, inverse, way);
                open.push(other);
            }
        }
    }
    offsets
}

/// The whole edges in a way between two particles, along which the cell repeats.
fn nearest_edges(cell: &SimulationCell, inverse: DMat3, way: DVec3) -> DVec3 {
    let edges = cell.vectors.iter().zip(cell.edges_in(inverse, way));
    edges.filter(|(_, number)| number.is_finite()).map(|(edge, number)| number * *edge).sum()
}

/// The particles that each one has bonds with.
struct Neighbours {
    /// Where those of each particle begin.
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Neighbours {
    fn new(count: usize, bonds: &[Bond]) -> Self {
        // Count the bonds of each particle, then store them one behind the other
        let is_valid = |bond: &&Bond| bond.iter().all(|index| (*index as usize) < count);
        let mut starts = vec![0_u32; count + 1];
        for index in bonds.iter().filter(is_valid).flatten() {
            starts[*index as usize + 1] += 1;
        }
        for index in 0..count {
            starts[index + 1] += starts[index];
        }
        let mut next = starts.clone();
        let mut others = vec![0; starts[count] as usize];
        for [a, b] in bonds.iter().filter(is_valid) {
            for [from, to] in [[*a, *b], [*b, *a]] {
                others[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Self { starts, others }
    }

    fn of(&self, particle: usize) -> impl Iterator<Item = usize> {
        let range = self.starts[particle] as usize..self.starts[particle + 1] as usize;
        self.others[range].iter().map(|other| *other as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Attribute, AttributeData, Positions};

    fn cell(periodic: [bool; 3]) -> SimulationCell {
        let edges = [DVec3::X * 10.0, DVec3::new(2.0, 10.0, 0.0), DVec3::Z * 10.0];
        SimulationCell::new(DVec3::ZERO, edges, periodic).unwrap()
    }

    fn whole(points: &[[f64; 3]], bonds: &[Bond], periodic: [bool; 3]) -> Vec<DVec3> {
        let points: Vec<DVec3> = points.iter().copied().map(DVec3::from_array).collect();
        let mut particles = RawParticles {
            positions: Positions::F64(points),
            bonds: bonds.to_vec(),
            ..RawParticles::default()
        };
        make_whole(&mut particles, &cell(periodic)).unwrap();
        let Positions::F64(points) = particles.positions else { panic!("f64") };
        points
    }

    #[test]
    fn molecules_are_made_whole_by_their_bonds() {
        // A chain that leaves the cell twice along x, a bond over a tilted edge, and a lone particle
        let points = [
            [9.0, 1.0, 1.0],
            [0.5, 1.0, 1.0],
            [9.8, 5.0, 5.0],
            [5.0, 0.5, 5.0],
            [6.5, 9.5, 5.0],
            [1.8, 1.0, 1.0],
        ];
        let bonds = [[0, 1], [5, 1], [3, 4], [3, 99]];
        let found = whole(&points, &bonds, [true; 3]);
        let expected = [
            [9.0, 1.0, 1.0],
            [10.5, 1.0, 1.0],
            [9.8, 5.0, 5.0],
            [5.0, 0.5, 5.0],
            [4.5, -0.5, 5.0],
            [11.8, 1.0, 1.0],
        ];
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (*found - DVec3::from_array(expected)).length() < 1e-12,
                "{found} {expected:?}"
            );
        }
        // Where the cell does not repeat, bonds may be long
        let fixed = whole(&points, &bonds, [false, true, false]);
        assert_eq!(fixed[1], DVec3::new(0.5, 1.0, 1.0));
    }

    #[test]
    fn image_flags_count_cells() {
        let flag = |name: &str, values: [i32; 2]| Attribute {
            name: name.to_owned(),
            components: 1,
            data: AttributeData::I32(values.to_vec()),
        };
        let mut particles = RawParticles {
            positions: Positions::F64(vec![DVec3::ONE; 2]),
            attributes: vec![flag("ix", [0, 2]), flag("iy", [0, -1]), flag("iz", [0, 0])],
            ..RawParticles::default()
        };
        make_whole(&mut particles, &cell([true; 3])).unwrap();
        assert_eq!(particles.positions.get(0), DVec3::ONE);
        assert_eq!(particles.positions.get(1), DVec3::new(19.0, -9.0, 1.0));
        particles.attributes.pop();
        let error = make_whole(&mut particles, &cell([true; 3])).unwrap_err();
        assert!(error.to_string().contains("neither bonds nor image flags"), "{error}");
    }
}
