//! Periodic images: particles wrapped into the simulation cell, and copies of it.

use glam::{DMat3, DVec3};

use crate::names::ID;
use crate::whole::{self, Molecules, make_whole};
use crate::with_values;
use crate::{
    Attribute, AttributeData, Bond, BondLengths, MemoryBudget, ParseError, Positions, RawParticles,
    SimulationCell,
};

/// Most particles after copying: indices have 32 bits.
const MAX_PARTICLES: u64 = u32::MAX as u64;

/// What is done with the particles of periodic cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PeriodicImages {
    /// Number of cells along each edge, at least 1.
    pub replicate: [u32; 3],
    /// Whether particles are moved into the cell, along the edges along which it repeats.
    pub wrap: bool,
    /// Whether molecules are made whole, after wrapping: by their bonds, or without bonds by image flags, or without both
    /// by bonds between atoms that are near each other.
    pub unwrap: bool,
}

impl Default for PeriodicImages {
    fn default() -> Self {
        Self { replicate: [1; 3], wrap: false, unwrap: false }
    }
}

impl PeriodicImages {
    /// Whether particles stay as they are.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Number of cells.
    pub fn count(&self) -> u64 {
        let [a, b, c] = self.replicate.map(u64::from);
        a.saturating_mul(b).saturating_mul(c)
    }

    /// Bytes that [`Self::move_particles`] needs at most beside `count` particles.
    pub const fn bytes_to_move(&self, count: u64) -> u64 {
        if self.unwrap { count.saturating_mul(whole::BYTES_EACH) } else { 0 }
    }

    /// Wraps and unwraps `particles`, and returns what that shows of their molecules. `lengths` are those of bonds between
    /// atoms, in files without bonds.
    ///
    /// # Errors
    /// There is no cell, it has no volume, or nothing says what a molecule is.
    pub fn move_particles(
        &self,
        particles: &mut RawParticles,
        lengths: Option<&BondLengths>,
        budget: MemoryBudget,
    ) -> Result<Molecules, ParseError> {
        if self.is_none() {
            return Ok(Molecules::Unknown);
        }
        let unsupported = |what: &str| ParseError::unsupported(what);
        let cell = particles
            .cell
            .ok_or_else(|| unsupported("no simulation cell, which copies and wrapping need"))?;
        if self.wrap {
            let inverse = cell.fractions().ok_or_else(|| {
                unsupported("the simulation cell has no volume, so that nothing can be wrapped")
            })?;
            particles.positions.each(|p| wrapped(&cell, inverse, p));
        }
        if !self.unwrap {
            return Ok(Molecules::Unknown);
        }
        make_whole(particles, &cell, lengths, budget)
    }

    /// Copies `particles`; the cell grows to all copies. The first particles are those of the file, then follow the copies,
    /// with the number along the first edge rising fastest. Copies have the attributes of the original, and an attribute
    /// `id` with the index in the file if there are no ids.
    ///
    /// # Errors
    /// There is no cell, or there are too many copies.
    pub fn copy_particles(
        &self,
        particles: &mut RawParticles,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        if self.count() <= 1 {
            return Ok(());
        }
        let cell = particles.cell.ok_or_else(|| {
            ParseError::unsupported("no simulation cell, which copies and wrapping need")
        })?;
        self.copy(particles, &cell, budget)
    }

    fn copy(
        &self,
        particles: &mut RawParticles,
        cell: &SimulationCell,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        let count = particles.positions.len();
        // Check that the copies can be counted and numbered
        let most = MAX_PARTICLES / (count as u64).max(1);
        let copies = usize::try_from(self.count()).ok();
        let Some(copies) = copies.filter(|copies| *copies as u64 <= most) else {
            let what = format!(
                "{} copies of {count} particles are more than {MAX_PARTICLES} particles",
                self.count()
            );
            return Err(ParseError::unsupported(what));
        };
        // Copies have the id of their particle
        if !particles.attributes.iter().any(is_id) {
            particles.attributes.push(Attribute {
                name: ID[0].to_owned(),
                components: 1,
                data: AttributeData::U32((0..=u32::MAX).take(count).collect()),
            });
        }
        // Check that they fit into memory
        let need = particles.byte_len().saturating_mul(self.count());
        budget.check(need, "its copies in memory are")?;
        particles.bonds = self.copied_bonds(particles, cell);
        // One array at a time
        match &mut particles.positions {
            Positions::F32(v) => repeat(v, copies),
            Positions::F64(v) => repeat(v, copies),
        }
        for attribute in &mut particles.attributes {
            with_values!(&mut attribute.data, v => repeat(v, copies));
        }
        // Move each copy by its image, and enlarge the cell
        let mut index = 0;
        particles.positions.each(|position| {
            let image = index / count;
            index += 1;
            position + self.offset(cell, image)
        });
        let [a, b, c] = cell.vectors;
        let [na, nb, nc] = self.replicate.map(f64::from);
        particles.cell = Some(SimulationCell { vectors: [na * a, nb * b, nc * c], ..*cell });
        Ok(())
    }

    /// The bonds between copies: each joins a particle with the nearest image of the other, which may be in another copy
    /// of the cell, or in that on the other side of all copies.
    #[expect(clippy::cast_possible_truncation, reason = "indices fit into 32 bits")]
    fn copied_bonds(&self, particles: &RawParticles, cell: &SimulationCell) -> Vec<Bond> {
        let inverse = cell.fractions().unwrap_or(DMat3::ZERO);
        let count = particles.positions.len();
        let counts = self.replicate.map(i64::from);
        let mut bonds = Vec::with_capacity(particles.bonds.len() * self.count() as usize);
        for bond in &particles.bonds {
            let [from, to] = bond.map(|index| particles.positions.get(index as usize));
            let cells = cell.edges_in(inverse, to - from).map(|number| number as i64);
            for image in 0..self.count() as usize {
                let along = self.along(image);
                let other: [usize; 3] = std::array::from_fn(|edge| {
                    (along[edge] as i64 - cells[edge]).rem_euclid(counts[edge]) as usize
                });
                let [na, nb, _] = self.replicate.map(|n| n as usize);
                let other = (other[2] * nb + other[1]) * na + other[0];
                let [a, b] = bond.map(|index| index as usize);
                bonds.push([(image * count + a) as u32, (other * count + b) as u32]);
            }
        }
        bonds
    }

    /// The number of image `index` along each edge.
    fn along(&self, index: usize) -> [usize; 3] {
        let [na, nb, _] = self.replicate.map(|n| n as usize);
        [index % na, index / na % nb, index / na / nb]
    }

    /// Where image `index` is relative to the original.
    #[expect(clippy::cast_precision_loss, reason = "numbers of images")]
    fn offset(&self, cell: &SimulationCell, index: usize) -> DVec3 {
        let edges = cell.vectors.into_iter().zip(self.along(index));
        edges.map(|(edge, number)| number as f64 * edge).sum()
    }
}

fn is_id(attribute: &Attribute) -> bool {
    attribute.components == 1 && crate::names::is_one_of(&attribute.name, &ID)
}

/// Appends copies of `items` until there are `copies` of them.
fn repeat<T: Copy>(items: &mut Vec<T>, copies: usize) {
    let count = items.len();
    if count == 0 {
        return;
    }
    items.reserve_exact(count * (copies - 1));
    for _ in 1..copies {
        items.extend_from_within(..count);
    }
}

/// The image of `position` in the cell. Whole edges are subtracted, so that a particle in the cell stays where it is.
pub(super) fn wrapped(cell: &SimulationCell, inverse: DMat3, position: DVec3) -> DVec3 {
    let cells = (inverse * (position - cell.origin)).floor().to_array();
    let mut moved = position;
    for ((edge, count), is_periodic) in cell.vectors.iter().zip(cells).zip(cell.periodic) {
        if is_periodic && count != 0.0 {
            moved -= count * *edge;
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGES: [DVec3; 3] =
        [DVec3::new(4.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0), DVec3::new(-0.5, 0.75, 2.0)];
    const ORIGIN: DVec3 = DVec3::new(10.0, -20.0, 5.0);

    fn particles(positions: Vec<DVec3>, periodic: [bool; 3]) -> RawParticles {
        let speeds = (0..positions.len()).map(|i| i as f32).collect();
        RawParticles {
            attributes: vec![Attribute {
                name: "speed".to_owned(),
                components: 1,
                data: AttributeData::F32(speeds),
            }],
            positions: Positions::F64(positions),
            cell: SimulationCell::new(ORIGIN, EDGES, periodic),
            ..RawParticles::default()
        }
    }

    /// The position with these fractions of the edges.
    fn at([a, b, c]: [f64; 3]) -> DVec3 {
        ORIGIN + a * EDGES[0] + b * EDGES[1] + c * EDGES[2]
    }

    fn applied(images: PeriodicImages, mut particles: RawParticles) -> RawParticles {
        let unlimited = MemoryBudget::UNLIMITED;
        images.move_particles(&mut particles, None, unlimited).expect("a cell");
        images.copy_particles(&mut particles, unlimited).expect("a cell");
        particles
    }

    #[test]
    fn particles_are_wrapped_into_a_tilted_cell() {
        let inside = at([0.25, 0.5, 0.75]);
        let moved = [[2.0, -3.0, 5.0], [0.0; 3], [-1e6, 1e6, 1.0], [0.0, -1.0, 0.0]];
        let positions = moved.map(|[a, b, c]| at([0.25 + a, 0.5 + b, 0.75 + c]));
        let nan = DVec3::new(f64::NAN, 0.0, 0.0);
        let all = [&positions[..], &[nan]].concat();
        let images = PeriodicImages { wrap: true, ..PeriodicImages::default() };
        let wrapped = applied(images, particles(all.clone(), [true; 3]));
        for i in 0..4 {
            let distance = wrapped.positions.get(i).distance(inside);
            assert!(distance < 1e-8, "{i}: {distance:e}");
        }
        // One that is inside keeps its bits
        assert_eq!(wrapped.positions.get(1), positions[1]);
        assert!(wrapped.positions.get(4).is_nan());
        // Only along the edges along which the cell repeats
        let wrapped = applied(images, particles(all, [true, false, true]));
        let expected = at([0.25, 0.5 - 3.0, 0.75]);
        assert!(wrapped.positions.get(0).distance(expected) < 1e-12);
    }

    #[test]
    fn copies_are_whole_edges_apart_with_the_ids_of_their_originals() {
        let positions = vec![at([0.1, 0.2, 0.3]), at([0.9, -0.4, 0.5])];
        let images = PeriodicImages { replicate: [2, 3, 1], wrap: false, unwrap: false };
        let copies = applied(images, particles(positions.clone(), [true; 3]));
        assert_eq!(copies.positions.len(), 12);
        let mut index = 0;
        for b in 0..3 {
            for a in 0..2 {
                for original in &positions {
                    let expected = *original + f64::from(a) * EDGES[0] + f64::from(b) * EDGES[1];
                    assert_eq!(copies.positions.get(index), expected, "{index}");
                    index += 1;
                }
            }
        }
        let find = |name: &str| copies.attributes.iter().find(|a| a.name == name).unwrap();
        assert_eq!(find("id").data, AttributeData::U32([0, 1].repeat(6)));
        assert_eq!(find("speed").data, AttributeData::F32([0.0, 1.0].repeat(6)));
        let cell = copies.cell.unwrap();
        assert_eq!(cell.origin, ORIGIN);
        assert_eq!(cell.vectors, [2.0 * EDGES[0], 3.0 * EDGES[1], EDGES[2]]);
        // Ids of the file stay
        let mut named = particles(positions, [true; 3]);
        named.attributes[0].name = "ID".to_owned();
        let copies = applied(images, named);
        assert_eq!(copies.attributes.len(), 1);
        assert_eq!(copies.attributes[0].data, AttributeData::F32([0.0, 1.0].repeat(6)));
    }

    #[test]
    fn bonds_of_copies_join_the_nearest_images() {
        // A bond in the cell, and one over the boundary of edge a
        let positions = vec![at([0.4, 0.5, 0.5]), at([0.6, 0.5, 0.5]), at([1.1, 0.5, 0.5])];
        let positions = [positions, vec![at([0.05, 0.5, 0.5]), at([0.95, 0.5, 0.5])]].concat();
        let mut one = particles(positions, [true; 3]);
        one.bonds = vec![[0, 1], [3, 4]];
        let images = PeriodicImages { replicate: [2, 1, 2], wrap: false, unwrap: false };
        let copies = applied(images, one);
        // Copies along a have 5 particles each, those along c 10
        let expected = [[[0, 1], [5, 6], [10, 11], [15, 16]], [[3, 9], [8, 4], [13, 19], [18, 14]]];
        assert_eq!(copies.bonds, expected.concat());
        // Those that do not cross the outer boundary are short
        for [a, b] in [[8, 4], [18, 14]] {
            let [a, b] = [a, b].map(|i| copies.positions.get(i));
            assert!(a.distance(b) < 0.11 * 4.0, "{a} {b}");
        }
    }

    #[test]
    fn cells_without_volume_and_too_many_copies_are_errors() {
        let fails = |images: PeriodicImages, mut particles: RawParticles, budget| {
            let moved = images.move_particles(&mut particles, None, budget);
            let error = moved.and_then(|_| images.copy_particles(&mut particles, budget));
            error.unwrap_err().to_string()
        };
        let wrap = PeriodicImages { wrap: true, ..PeriodicImages::default() };
        let copy = |replicate| PeriodicImages { replicate, wrap: false, unwrap: false };
        let unlimited = MemoryBudget::UNLIMITED;
        let one = || particles(vec![ORIGIN; 5], [true; 3]);
        let mut none = one();
        none.cell = None;
        let error = fails(wrap, none, unlimited);
        assert!(error.contains("no simulation cell, which copies"), "{error}");
        let mut flat = one();
        flat.cell = SimulationCell::new(ORIGIN, [EDGES[0], EDGES[1], DVec3::ZERO], [true; 3]);
        let error = fails(wrap, flat, unlimited);
        assert!(error.contains("has no volume"), "{error}");
        let error = fails(copy([1000, 1000, 1000]), one(), unlimited);
        assert!(error.contains("1000000000 copies of 5 particles"), "{error}");
    }
}
