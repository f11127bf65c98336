//! Molecules of periodic cells made whole, so that no bond crosses the cell.

use glam::{DMat3, DVec3};

use crate::{Bond, BondLengths, MemoryBudget, ParseError, RawParticles, SimulationCell};
use bins::{AtomBins, Cells, edges};

mod bins;

/// Names of the attributes with the number of cells that a particle has crossed along each edge, as LAMMPS writes them.
const IMAGE_FLAGS: [&str; 3] = ["ix", "iy", "iz"];

/// Most bonds by distance for each particle, on average; more mean another unit of lengths.
const MAX_BONDS_EACH: usize = 8;

/// Bytes for each particle while molecules are made whole: by distance, which needs most; where it is placed, and lists of
/// those that are open and of a molecule.
pub(super) const BYTES_EACH: u64 = (bins::BYTES_EACH + size_of::<Cells>() + 4 + 16) as u64;

/// The molecule of particles that have not been found yet.
const NONE: u32 = u32::MAX;

/// Which particles stay together.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Molecules {
    /// Nothing is known of molecules.
    #[default]
    Unknown,
    /// Molecules have been made whole by their bonds.
    Whole {
        /// The number of the molecule of each particle.
        of: Vec<u32>,
        /// How many molecules there are, those of one particle included.
        count: u32,
    },
    /// Particles are where they have moved to over time, any number of cells away.
    Unfolded,
}

/// Moves the particles of `particles` by whole edges of their `cell`: each to the image that is nearest to the particle that
/// it has a bond with; without bonds by the image flags; without both next to those that are as near as bonds of
/// `lengths`. Adds a note on bonds that were found by distance.
///
/// # Errors
/// There are neither bonds nor image flags nor elements, the cell has no volume, or bonds need too much memory.
pub(super) fn make_whole(
    particles: &mut RawParticles,
    cell: &SimulationCell,
    lengths: Option<&BondLengths>,
    budget: MemoryBudget,
) -> Result<Molecules, ParseError> {
    let inverse = || {
        cell.fractions().ok_or_else(|| {
            ParseError::unsupported(
                "the simulation cell has no volume, so that nothing can be unwrapped",
            )
        })
    };
    if !particles.bonds.is_empty() {
        let placed = by_bonds(particles, cell, inverse()?);
        return Ok(placed.apply(particles, cell));
    }
    if let Some(offsets) = by_flags(particles, cell) {
        let mut offsets = offsets.into_iter();
        particles.positions.each(|position| position + offsets.next().unwrap_or(DVec3::ZERO));
        return Ok(Molecules::Unfolded);
    }
    let count = particles.positions.len() as u64;
    budget.check(
        particles.byte_len().saturating_add(BYTES_EACH.saturating_mul(count)),
        "with the bonds by distance that cell.unwrap finds it is",
    )?;
    let inverse = inverse()?;
    let bins = lengths.and_then(|lengths| AtomBins::new(particles, (cell, inverse), lengths));
    let bins = match bins {
        None if count > 0 => {
            return Err(ParseError::unsupported(
                "neither bonds nor image flags (ix, iy, iz) nor elements, one of which cell.unwrap needs; --topology \
                 gives bonds and elements",
            ));
        }
        bins => bins,
    };
    let mut placed = Placed::new(particles.positions.len());
    if let Some(bins) = &bins {
        placed = by_distance(particles.positions.len(), bins)?;
    }
    drop(bins);
    particles.notes.extend(placed.notes());
    Ok(placed.apply(particles, cell))
}

/// Where the particles of molecules are placed.
struct Placed {
    /// By how many cells each particle moves.
    offsets: Vec<Cells>,
    /// The molecule of each particle.
    molecules: Vec<u32>,
    /// Number of molecules.
    count: u32,
    /// How many of them the boundary cut.
    cut: usize,
    /// How many have bonds with their own images.
    endless: usize,
}

impl Placed {
    fn new(count: usize) -> Self {
        let (offsets, molecules) = (vec![[0; 3]; count], vec![NONE; count]);
        Self { offsets, molecules, count: 0, cut: 0, endless: 0 }
    }

    /// What the user should know of bonds by distance.
    fn notes(&self) -> Vec<String> {
        let mut notes = vec![format!(
            "the file has no bonds: cell.unwrap found them by distance, by covalent radii; molecules that the boundary cut \
             and that were made whole: {}",
            self.cut
        )];
        if self.endless > 0 {
            notes.push(format!(
                "networks with bonds to their own images across the boundary, such as crystals, which cannot be made \
                 whole and stay as they are: {}",
                self.endless
            ));
        }
        notes
    }

    fn apply(self, particles: &mut RawParticles, cell: &SimulationCell) -> Molecules {
        let mut offsets = self.offsets.into_iter();
        particles.positions.each(|position| {
            let cells = offsets.next().unwrap_or_default();
            if cells == [0; 3] { position } else { position + edges(cell, cells) }
        });
        Molecules::Whole { of: self.molecules, count: self.count }
    }

    /// Places molecule after molecule along its bonds. The particle that comes first in each stays where it is.
    /// `each_bond` calls its last argument with the particles that one has bonds with, and by how many cells those move
    /// to be next to it; the number of cells is that by which it has moved itself.
    ///
    /// `keeps_endless`: molecules with bonds to their own images stay where they are, and each of their particles counts
    /// as a molecule.
    fn walk(
        &mut self,
        keeps_endless: bool,
        mut each_bond: impl FnMut(usize, Cells, &mut dyn FnMut(usize, Cells)) -> Result<(), ParseError>,
    ) -> Result<(), ParseError> {
        let (mut open, mut members) = (Vec::new(), Vec::new());
        for first in 0..self.molecules.len() {
            if self.molecules[first] != NONE {
                continue;
            }
            // Place each particle next to the one that it was found by
            let own = self.count;
            self.count += 1;
            self.molecules[first] = own;
            open.push(first);
            members.clear();
            let (mut is_cut, mut is_endless) = (false, false);
            while let Some(placed) = open.pop() {
                members.push(placed);
                each_bond(placed, self.offsets[placed], &mut |other, cells| {
                    if self.molecules[other] == NONE {
                        self.molecules[other] = own;
                        self.offsets[other] = cells;
                        is_cut |= cells != [0; 3];
                        open.push(other);
                    } else {
                        is_endless |= self.offsets[other] != cells;
                    }
                })?;
            }
            if !is_endless {
                self.cut += usize::from(is_cut);
                continue;
            }
            // Put those of a network back
            self.endless += 1;
            if keeps_endless {
                for (member, molecule) in members.iter().zip(own..) {
                    self.offsets[*member] = [0; 3];
                    self.molecules[*member] = molecule;
                    self.count = molecule + 1;
                }
            }
        }
        Ok(())
    }
}

/// Places particles next to those that are as near as a bond is long.
fn by_distance(count: usize, bins: &AtomBins<'_>) -> Result<Placed, ParseError> {
    let mut placed = Placed::new(count);
    // Each bond is found from both of its ends
    let mut left = count.saturating_mul(2 * MAX_BONDS_EACH).max(1 << 10);
    placed.walk(true, |particle, moved, visit| {
        let found = bins.each_bond(particle, |other, cells| {
            left = left.checked_sub(1)?;
            let sum = |edge: usize| moved[edge].saturating_add(cells[edge]);
            visit(other, std::array::from_fn(sum));
            Some(())
        });
        found.ok_or_else(|| {
            ParseError::unsupported(format!(
                "bonds by distance, which cell.unwrap finds, are more than {MAX_BONDS_EACH} for each of {count} \
                 particles, on average; lengths may have another unit than angstroms; --topology gives bonds"
            ))
        })
    })?;
    Ok(placed)
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

/// Places particles next to those that they have bonds with. Where bonds cross the boundary to the image of their own
/// molecule, one of them remains long.
fn by_bonds(particles: &RawParticles, cell: &SimulationCell, inverse: DMat3) -> Placed {
    let count = particles.positions.len();
    let neighbours = Neighbours::new(count, &particles.bonds);
    let mut placed = Placed::new(count);
    let walked = placed.walk(false, |particle, moved, visit| {
        let from = particles.positions.get(particle) + edges(cell, moved);
        for other in neighbours.of(particle) {
            let way = particles.positions.get(other) - from;
            #[expect(clippy::cast_possible_truncation, reason = "saturates, and NaN is 0")]
            let cells = cell.edges_in(inverse, way).map(|number| -number as i32);
            visit(other, cells);
        }
        Ok(())
    });
    walked.expect("listed bonds have no limit");
    placed
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
mod distance_tests;
#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Attribute, AttributeData, Positions};

    fn cell(periodic: [bool; 3]) -> SimulationCell {
        let edges = [DVec3::X * 10.0, DVec3::new(2.0, 10.0, 0.0), DVec3::Z * 10.0];
        SimulationCell::new(DVec3::ZERO, edges, periodic).unwrap()
    }

    fn make_whole(particles: &mut RawParticles, cell: &SimulationCell) -> Result<(), ParseError> {
        super::make_whole(particles, cell, None, MemoryBudget::UNLIMITED).map(|_| ())
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
