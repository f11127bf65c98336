//! Bonds by distance in a periodic cell: atoms in bins, so that those near each other are found in linear time.

use glam::{DMat3, DVec3};

use crate::{BondLengths, RawParticles, SimulationCell};

/// Numbers of cells along each edge.
pub(super) type Cells = [i32; 3];

/// Bytes for each particle: an atom, its slot, what sorts it, and the beginnings of bins.
pub(super) const BYTES_EACH: usize = size_of::<Atom>() + 4 + 16 + 4 * MAX_BINS_EACH;

/// Most bins for each atom, on average.
const MAX_BINS_EACH: usize = 4;

/// Most bins next to one, along an edge in each direction; there is one, unless the cell is shorter than a bond.
const MAX_STEPS: i32 = 4;

/// How much larger bins are than the longest bond, against rounding.
const MARGIN: f64 = 1.001;

/// Particles that are more cells away from the cell are left out, like those without a finite position.
const MAX_CELLS: f64 = 1e6;

/// The slot of a particle without bonds.
const NONE: u32 = u32::MAX;

/// An atom that may have bonds.
#[derive(Debug, Clone, Copy)]
struct Atom {
    /// Its image in the cell.
    position: DVec3,
    /// Its share in the lengths of bonds.
    share: f64,
    /// How many cells it is away from that image.
    cells: Cells,
    particle: u32,
}

/// The bins along one edge.
#[derive(Debug, Clone, Copy)]
struct Axis {
    /// Where they begin, and their extent, in fractions of the edge.
    start: f64,
    extent: f64,
    bins: i32,
    /// The part of the edge that has the length one between the faces of the cell at both of its ends.
    unit: f64,
    is_periodic: bool,
}

impl Axis {
    /// The bin of a fraction of the edge, if there were more on both sides.
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    fn place(&self, fraction: f64) -> i32 {
        ((fraction - self.start) / self.extent * f64::from(self.bins)).floor() as i32
    }

    fn bin(&self, fraction: f64) -> i32 {
        self.place(fraction).clamp(0, self.bins - 1)
    }

    /// The bins up to a distance around a fraction of the edge, each with the number of cells to its image.
    fn around(&self, fraction: f64, distance: f64) -> impl Iterator<Item = (i32, i32)> {
        let axis = *self;
        let (own, reach) = (axis.bin(fraction), MARGIN * distance * axis.unit);
        let first = axis.place(fraction - reach).max(own - MAX_STEPS);
        let last = axis.place(fraction + reach).min(own + MAX_STEPS);
        (first..=last).filter_map(move |place| {
            let cells = place.div_euclid(axis.bins);
            (axis.is_periodic || cells == 0).then(|| (place.rem_euclid(axis.bins), cells))
        })
    }
}

/// The atoms of a frame that may have bonds, by bins.
pub(super) struct AtomBins<'a> {
    cell: &'a SimulationCell,
    inverse: DMat3,
    axes: [Axis; 3],
    /// The largest share.
    largest: f64,
    /// Sorted by bins.
    atoms: Vec<Atom>,
    /// Where the atoms of each bin begin.
    starts: Vec<u32>,
    /// Where each particle is among the atoms.
    slots: Vec<u32>,
}

impl<'a> AtomBins<'a> {
    /// None if no particle is an atom with bonds.
    pub(super) fn new(
        particles: &RawParticles,
        (cell, inverse): (&'a SimulationCell, DMat3),
        lengths: &BondLengths,
    ) -> Option<Self> {
        let mut atoms = atoms_of(particles, (cell, inverse), lengths)?;
        let largest = atoms.iter().map(|atom| atom.share).fold(0.0, f64::max);
        let axes = axes_of(cell, inverse, &atoms, 2.0 * largest);
        let mut bins = Self {
            cell,
            inverse,
            axes,
            largest,
            atoms: Vec::new(),
            starts: Vec::new(),
            slots: vec![NONE; particles.positions.len()],
        };
        // Sort the atoms by bins; within a bin they keep their order
        atoms.sort_by_cached_key(|atom| bins.index(bins.place(atom.position)));
        let count = axes.iter().map(|axis| axis.bins as usize).product::<usize>();
        bins.starts = vec![0; count + 1];
        for (slot, atom) in (0..).zip(&atoms) {
            bins.slots[atom.particle as usize] = slot;
            let bin = bins.index(bins.place(atom.position)) as usize;
            bins.starts[bin + 1] += 1;
        }
        for bin in 0..count {
            bins.starts[bin + 1] += bins.starts[bin];
        }
        bins.atoms = atoms;
        Some(bins)
    }

    fn fractions(&self, position: DVec3) -> [f64; 3] {
        (self.inverse * (position - self.cell.origin)).to_array()
    }

    /// The bins of a position along each edge.
    fn place(&self, position: DVec3) -> [i32; 3] {
        let fractions = self.fractions(position);
        std::array::from_fn(|edge| self.axes[edge].bin(fractions[edge]))
    }

    #[expect(clippy::cast_sign_loss, reason = "bins are not negative")]
    fn index(&self, [a, b, c]: [i32; 3]) -> u32 {
        let [of_a, of_b, _] = self.axes.map(|axis| axis.bins as u32);
        (c as u32 * of_b + b as u32) * of_a + a as u32
    }

    /// Calls `visit` with each particle that `particle` has a bond with, and the cells between that and its image next to
    /// `particle`, until one call gives None.
    pub(super) fn each_bond(
        &self,
        particle: usize,
        mut visit: impl FnMut(usize, Cells) -> Option<()>,
    ) -> Option<()> {
        let Some(atom) = self.atoms.get(self.slots[particle] as usize) else {
            return Some(());
        };
        let [a, b, c] = self.fractions(atom.position);
        let [edge_a, edge_b, edge_c] = self.cell.vectors;
        let longest = atom.share + self.largest;
        for (c, cells_c) in self.axes[2].around(c, longest) {
            let offset = f64::from(cells_c) * edge_c - atom.position;
            for (b, cells_b) in self.axes[1].around(b, longest) {
                let offset = offset + f64::from(cells_b) * edge_b;
                for (a, cells_a) in self.axes[0].around(a, longest) {
                    let offset = offset + f64::from(cells_a) * edge_a;
                    let cells = [cells_a, cells_b, cells_c];
                    let bin = self.index([a, b, c]) as usize;
                    let range = self.starts[bin] as usize..self.starts[bin + 1] as usize;
                    for other in &self.atoms[range] {
                        let length = atom.share + other.share;
                        let is_self = other.particle == atom.particle && cells == [0; 3];
                        if (other.position + offset).length_squared() <= length * length && !is_self
                        {
                            let between =
                                |edge: usize| cells[edge] + atom.cells[edge] - other.cells[edge];
                            visit(other.particle as usize, std::array::from_fn(between))?;
                        }
                    }
                }
            }
        }
        Some(())
    }
}

/// The particles that may have bonds; none if there are none.
fn atoms_of(
    particles: &RawParticles,
    (cell, inverse): (&SimulationCell, DMat3),
    lengths: &BondLengths,
) -> Option<Vec<Atom>> {
    let is_element = |a: &&crate::Attribute| a.name == lengths.attribute();
    let elements = particles.attributes.iter().find(is_element)?;
    let mut atoms = Vec::with_capacity(particles.positions.len());
    for (index, particle) in (0..particles.positions.len()).zip(0_u32..) {
        let Some(share) = lengths.share(elements.magnitude(index)) else { continue };
        let position = particles.positions.get(index);
        let place = (inverse * (position - cell.origin)).floor();
        if !place.is_finite() || place.abs().max_element() > MAX_CELLS {
            continue;
        }
        #[expect(clippy::cast_possible_truncation, reason = "limited")]
        let cells = std::array::from_fn(|edge| {
            if cell.periodic[edge] { place.to_array()[edge] as i32 } else { 0 }
        });
        let position = position - edges(cell, cells);
        atoms.push(Atom { position, share, cells, particle });
    }
    (!atoms.is_empty()).then_some(atoms)
}

/// The bins for `atoms` whose bonds have at most the length `longest`.
fn axes_of(cell: &SimulationCell, inverse: DMat3, atoms: &[Atom], longest: f64) -> [Axis; 3] {
    let fractions = || atoms.iter().map(|atom| inverse * (atom.position - cell.origin));
    let min = fractions().fold(DVec3::INFINITY, DVec3::min).to_array();
    let max = fractions().fold(DVec3::NEG_INFINITY, DVec3::max).to_array();
    let size = (MARGIN * longest).max(f64::MIN_POSITIVE);
    let most = MAX_BINS_EACH * atoms.len();
    // The distance between the faces of the cell at both ends of an edge
    let height = |edge: usize| inverse.row(edge).length_recip();
    let mut axes: [Axis; 3] = std::array::from_fn(|edge| {
        let is_periodic = cell.periodic[edge];
        let (start, extent) =
            if is_periodic { (0.0, 1.0) } else { (min[edge], max[edge] - min[edge]) };
        #[expect(clippy::cast_possible_truncation, reason = "limited")]
        let bins = (extent * height(edge) / size).clamp(1.0, (most as f64).min(1e9)) as i32;
        let extent = extent.max(f64::MIN_POSITIVE);
        Axis { start, extent, bins, unit: height(edge).recip(), is_periodic }
    });
    // There are not many more bins than atoms
    while axes.iter().map(|axis| f64::from(axis.bins)).product::<f64>() > most as f64 {
        let longest = axes.iter_mut().max_by_key(|axis| axis.bins).expect("there are three");
        longest.bins = (longest.bins + 1) / 2;
    }
    axes
}

/// The sum of whole edges.
pub(super) fn edges(cell: &SimulationCell, cells: Cells) -> DVec3 {
    cell.vectors.iter().zip(cells).map(|(edge, number)| f64::from(number) * *edge).sum()
}
