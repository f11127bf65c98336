//! Bonds between the particles of a frame: those that are near each other, or those that the file lists.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{BVec3, Vec3};
use rayon::prelude::*;
use spherule_formats::{BondLengths, Lattice, SimulationCell};

use super::SharedFrame;
use super::load_error::{LoadError, missing};
use super::rods::FrameRods;
use super::setup::{BondRule, BondStyle, Setup};
use super::styles::StyleRanges;
use crate::scene::RadiusTable;
use crate::surface::field::FieldParticles;
use crate::surface::rods::{Caps, Rod};

/// Covalent bonds are as long as the sum of both radii and this tolerance, angstroms: the rule of the Cambridge
/// Structural Database (Allen, Acta Crystallographica B 58, 2002).
const TOLERANCE: f64 = 0.4;

/// Greatest number of bonds per particle, on average; in close packings, there are 6 between nearest neighbours.
pub(super) const MAX_BONDS_EACH: u64 = 8;

/// Number of particles that one task searches around.
const CHUNK: usize = 4096;

/// The greatest lengths of covalent bonds, by the atomic numbers in the attribute `name`; `angstrom` is the length of one.
pub(crate) fn covalent_lengths(name: &str, angstrom: f64) -> BondLengths {
    BondLengths::new(name, |number| {
        let radius = RadiusTable::Covalent.radius(f64::from(number))?;
        Some(angstrom * (radius + 0.5 * TOLERANCE))
    })
}

/// The bonds of `frame`, which was read from `file` and has this `number`. Passes notes to `notes`.
///
/// # Errors
/// The frame lacks an attribute, or there are too many bonds.
pub(super) fn bonds_of(
    setup: &Setup,
    (frame, ranges): (&SharedFrame<'_>, &StyleRanges),
    place: (i64, &str),
    notes: &mut Vec<String>,
) -> Result<Vec<FrameRods>, LoadError> {
    let styles = setup.picture.particles.styles.iter().enumerate();
    styles
        .filter_map(|(i, style)| Some((style.bonds.as_ref()?, ranges.of(i))))
        .filter(|(_, range)| !range.is_empty())
        .map(|(bonds, range)| bonds_in(setup, (frame, range), bonds, place, notes))
        .collect()
}

/// The bonds of the particles in a range of a frame; those with others are drawn up to the middle.
fn bonds_in(
    setup: &Setup,
    (frame, range): (&SharedFrame<'_>, Range<usize>),
    style: &BondStyle,
    (number, file): (i64, &str),
    notes: &mut Vec<String>,
) -> Result<FrameRods, LoadError> {
    // Find the bonds, by the rule of the manifest
    let near = |reach: Reach| {
        let search = Search::new(style.look.radius, reach, frame);
        (search.bonds(), "no particles are so near each other")
    };
    let (rods, none) = match &style.rule {
        BondRule::File => (listed(style.look.radius, frame), "the file lists none"),
        BondRule::Distance(distance) => near(Reach::distance(*distance)),
        BondRule::Covalent { name, angstrom } => {
            near(Reach::covalent((name, *angstrom), frame, file)?)
        }
    };
    let mut rods = rods
        .ok_or_else(|| LoadError::TooManyBonds { file: file.to_owned(), particles: frame.len() })?;
    if range.len() < frame.len() {
        rods = rods.into_iter().filter_map(|rod| within(rod, &range)).collect();
    }
    if rods.is_empty() {
        notes.push(format!("frame {number}: no bonds: {none}"));
    }
    // Each half has the colour of its particle
    let all = 0..frame.len();
    style.look.rods((setup, frame), (number, file), (rods, Caps::Flat), all)
}

/// The part of a bond that belongs to the particles in `range`.
fn within(rod: Rod, range: &Range<usize>) -> Option<Rod> {
    let [a, b] = rod.particles;
    let middle = 0.5 * (rod.ends[0] + rod.ends[1]);
    match [a, b].map(|particle| range.contains(&(particle as usize))) {
        [true, true] => Some(rod),
        [true, false] => Some(Rod { ends: [rod.ends[0], middle], particles: [a; 2], ..rod }),
        [false, true] => Some(Rod { ends: [rod.ends[1], middle], particles: [b; 2], ..rod }),
        [false, false] => None,
    }
}

/// Greatest number of bonds of `frame`.
const fn most_bonds(particles: usize) -> u64 {
    MAX_BONDS_EACH.saturating_mul(particles as u64)
}

/// The bonds that the file of `frame` lists; None if there are too many. Where the cell is periodic, each end goes to
/// the nearest image of the other particle: one that is across the boundary is drawn up to the middle from both sides.
fn listed(radius: f32, frame: &SharedFrame<'_>) -> Option<Vec<Rod>> {
    // Refuse more bonds than were planned for
    if frame.bonds.len() as u64 > most_bonds(frame.len()) {
        return None;
    }
    let lattice = frame.cell.as_ref().map(Lattice::new);
    let mut rods = Vec::with_capacity(frame.bonds.len());
    for bond in &frame.bonds {
        let [Some(a), Some(b)] = bond.map(|index| frame.positions.get(index as usize).copied())
        else {
            continue;
        };
        // Draw a bond, or two halves where it leaves the cell
        let image = lattice.as_ref().and_then(|lattice| lattice.image(b - a));
        let mut rod = |ends, particles| {
            rods.push(Rod { ends, radii: [radius; 2], particles });
        };
        match image {
            None => rod([a, b], *bond),
            Some(image) => {
                let half = 0.5 * (b - a - image);
                rod([a, a + half], [bond[0]; 2]);
                rod([b, b - half], [bond[1]; 2]);
            }
        }
    }
    Some(rods)
}

/// How far apart particles with a bond are at most.
struct Reach {
    /// The greatest distance, scene units.
    greatest: f32,
    /// The share of each particle in the distance; empty if the distance is the same for all. NaN for those without
    /// bonds.
    shares: Vec<f32>,
}

impl Reach {
    /// The same distance for all particles.
    const fn distance(greatest: f32) -> Self {
        Self { greatest, shares: Vec::new() }
    }

    /// Covalent radii with a tolerance, by the atomic numbers in the attribute `name`; `angstrom` is the length of one.
    fn covalent(
        (name, angstrom): (&str, f64),
        frame: &SharedFrame<'_>,
        file: &str,
    ) -> Result<Self, LoadError> {
        let elements = frame.attribute(name).ok_or_else(|| {
            let has = frame.attributes.iter().map(|a| a.name.as_str());
            missing(name, "covalent bonds", file, has)
        })?;
        let lengths = covalent_lengths(name, angstrom);
        #[expect(clippy::cast_possible_truncation, reason = "radii are f32 in the renderer")]
        let share = |particle: usize| {
            lengths.share(elements.magnitude(particle)).map_or(f32::NAN, |share| share as f32)
        };
        let shares: Vec<f32> = (0..frame.len()).map(share).collect();
        // `max` ignores NaN
        let greatest = 2.0 * shares.iter().copied().fold(0.0, f32::max);
        Ok(Self { greatest, shares })
    }

    /// The square of the greatest length of a bond between two particles; NaN if they have none.
    fn squared(&self, a: usize, b: u32) -> f32 {
        let length = match self.shares.get(a).zip(self.shares.get(b as usize)) {
            Some((a, b)) => a + b,
            None => self.greatest,
        };
        length * length
    }
}

/// The particles of a frame, and what their bonds are made from.
struct Search<'a> {
    radius: f32,
    reach: Reach,
    positions: &'a [Vec3],
    bins: FieldParticles,
    /// Where the images of the periodic cell around it are.
    images: Vec<Vec3>,
    /// The box that contains all particles within reach of one of the frame.
    bounds: [Vec3; 2],
}

impl<'a> Search<'a> {
    fn new(radius: f32, reach: Reach, frame: &'a SharedFrame<'_>) -> Self {
        let positions = &frame.positions[..];
        // Bins need a size; a margin keeps particles at the greatest distance in neighbouring bins
        let size = (1.001 * reach.greatest).max(f32::MIN_POSITIVE);
        let min = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let max = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        Self {
            radius,
            bins: FieldParticles::sorted(positions, size, true),
            images: frame.cell.as_ref().map(SimulationCell::images_around).unwrap_or_default(),
            bounds: [min - reach.greatest, max + reach.greatest],
            reach,
            positions,
        }
    }

    /// All bonds, in the order of the particles; None if there are too many.
    fn bonds(&self) -> Option<Vec<Rod>> {
        let found = AtomicU64::new(0);
        let most = most_bonds(self.positions.len());
        let starts: Vec<usize> = (0..self.positions.len()).step_by(CHUNK).collect();
        let chunk = |start: &usize| {
            let mut rods = Vec::new();
            for particle in *start..(start + CHUNK).min(self.positions.len()) {
                let before = rods.len();
                self.add_bonds_of(particle, &mut rods);
                let added = (rods.len() - before) as u64;
                if found.fetch_add(added, Ordering::Relaxed) + added > most {
                    return None;
                }
            }
            Some(rods)
        };
        let chunks: Option<Vec<Vec<Rod>>> = starts.par_iter().map(chunk).collect();
        Some(chunks?.concat())
    }

    /// Adds the bonds of a particle to those with greater indices, and its halves of the bonds that leave the periodic
    /// cell. Each end of these is drawn from its particle to the middle.
    fn add_bonds_of(&self, particle: usize, rods: &mut Vec<Rod>) {
        // A bond belongs to the particle with the lower index
        let point = self.positions[particle];
        let Ok(own) = u32::try_from(particle) else {
            return;
        };
        let mut bond = |offset: Vec3, length: f32, other: u32| {
            rods.push(Rod {
                ends: [point, point + length * offset],
                radii: [self.radius; 2],
                particles: [own, other],
            });
        };
        // Add bonds within the cell
        self.bins.each_offset(point, |other, offset| {
            if other > own && offset.length_squared() <= self.reach.squared(particle, other) {
                bond(offset, 1.0, other);
            }
        });
        // Add halves of those across its boundary, which the other particle has too
        for image in &self.images {
            let moved = point + *image;
            let [min, max] = self.bounds;
            if moved.cmplt(min) | moved.cmpgt(max) != BVec3::FALSE {
                continue;
            }
            self.bins.each_offset(moved, |other, offset| {
                if offset.length_squared() <= self.reach.squared(particle, other) {
                    bond(offset, 0.5, own);
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use spherule_formats::order::index_u32;
    use spherule_formats::{Attribute, AttributeData, ParticleFrame};

    use super::*;

    /// `count` particles in a cell of edges 6, 5 and 4, by a linear congruential generator.
    fn frame(count: usize, periodic: [bool; 3]) -> SharedFrame<'static> {
        let mut state = 7_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let positions: Vec<Vec3> =
            (0..count).map(|_| Vec3::new(6.0 * next(), 5.0 * next(), 4.0 * next())).collect();
        let elements = (0..count).map(|i| [1, 6, 8, 0][i % 4]).collect();
        let edges = [DVec3::X * 6.0, DVec3::Y * 5.0, DVec3::Z * 4.0];
        ParticleFrame {
            positions: positions.into(),
            origin: DVec3::ZERO,
            radius: None,
            attributes: vec![Attribute {
                name: "element".to_owned(),
                components: 1,
                data: AttributeData::I32(elements),
            }],
            time: None,
            cell: SimulationCell::new(DVec3::ZERO, edges, periodic),
            bonds: Vec::new(),
            shapes: None,
            dropped: 0,
            file_index: None,
        }
    }

    fn bonds(frame: &SharedFrame<'_>, reach: Reach) -> Option<Vec<Rod>> {
        Search::new(0.1, reach, frame).bonds()
    }

    /// Pairs and halves, by brute force in f64; `length` is the greatest length of the bond of two particles.
    fn expected(
        frame: &SharedFrame<'_>,
        length: impl Fn(usize, usize) -> Option<f64>,
    ) -> (Vec<[u32; 2]>, Vec<u32>) {
        let cell = frame.cell.unwrap();
        let images = cell.images_around();
        let (mut pairs, mut halves) = (Vec::new(), Vec::new());
        for a in 0..frame.len() {
            for b in 0..frame.len() {
                let Some(length) = length(a, b) else { continue };
                let way = frame.positions[b].as_dvec3() - frame.positions[a].as_dvec3();
                if a < b && way.length() <= length {
                    pairs.push([a, b].map(index_u32));
                }
                let near = images.iter().filter(|i| (way - i.as_dvec3()).length() <= length);
                halves.extend(near.map(|_| index_u32(a)));
            }
        }
        (pairs, halves)
    }

    /// The pairs of whole bonds, and the particles of halves, sorted.
    fn found(rods: &[Rod]) -> (Vec<[u32; 2]>, Vec<u32>) {
        let (halves, pairs): (Vec<&Rod>, _) =
            rods.iter().partition(|rod| rod.particles[0] == rod.particles[1]);
        let mut pairs: Vec<[u32; 2]> = pairs.into_iter().map(|rod| rod.particles).collect();
        pairs.sort_unstable();
        (pairs, halves.into_iter().map(|rod| rod.particles[0]).collect())
    }

    #[test]
    fn bonds_by_distance_are_those_of_brute_force() {
        for periodic in [[false; 3], [true, false, true], [true; 3]] {
            let frame = frame(300, periodic);
            let rods = bonds(&frame, Reach::distance(0.8)).unwrap();
            let (pairs, halves) = expected(&frame, |_, _| Some(0.8));
            assert!(pairs.len() > 300, "{}", pairs.len());
            assert_eq!(halves.is_empty(), periodic == [false; 3]);
            assert_eq!(found(&rods), (pairs, halves), "{periodic:?}");
            // Whole bonds go from particle to particle
            for rod in &rods {
                let [a, b] = rod.particles;
                assert_eq!(rod.ends[0], frame.positions[a as usize]);
                let end = frame.positions[b as usize];
                assert!(a == b || rod.ends[1].distance(end) < 1e-6);
                let length = rod.ends[0].distance(rod.ends[1]);
                assert!(length <= if a == b { 0.4 } else { 0.8 } + 1e-6);
            }
        }
    }

    #[test]
    fn halves_of_a_bond_over_the_boundary_meet_in_its_middle() {
        let mut frame = frame(2, [true, true, true]);
        frame.positions = vec![Vec3::new(0.25, 1.0, 3.75), Vec3::new(5.75, 1.0, 0.25)].into();
        let rods = bonds(&frame, Reach::distance(0.8)).unwrap();
        let ends: Vec<[Vec3; 2]> = rods.iter().map(|rod| rod.ends).collect();
        let expected = [
            [Vec3::new(0.25, 1.0, 3.75), Vec3::new(0.0, 1.0, 4.0)],
            [Vec3::new(5.75, 1.0, 0.25), Vec3::new(6.0, 1.0, 0.0)],
        ];
        assert_eq!(ends, expected);
    }

    #[test]
    fn covalent_bonds_are_those_of_brute_force() {
        let frame = frame(300, [true; 3]);
        let angstrom = 0.5;
        let reach = Reach::covalent(("element", angstrom), &frame, "in").unwrap();
        let rods = bonds(&frame, reach).unwrap();
        let radius = |i: usize| [Some(0.31), Some(0.76), Some(0.66), None][i % 4];
        let length = |a: usize, b: usize| Some(angstrom * (radius(a)? + radius(b)? + 0.4));
        let (pairs, halves) = expected(&frame, length);
        assert!(pairs.len() > 200 && halves.len() > 20, "{}", pairs.len());
        assert_eq!(found(&rods), (pairs, halves));
    }

    #[test]
    fn too_many_bonds_are_refused() {
        let frame = frame(2000, [true; 3]);
        assert!(bonds(&frame, Reach::distance(3.0)).is_none());
        assert!(bonds(&frame, Reach::distance(0.2)).is_some());
        let empty = frame_at(&[]);
        assert_eq!(bonds(&empty, Reach::distance(3.0)), Some(Vec::new()));
        // Particles in one place have no direction to draw a bond in
        let one_place = frame_at(&[Vec3::ONE; 3]);
        let rods = bonds(&one_place, Reach::distance(3.0)).unwrap();
        assert!(crate::surface::rods::RodTree::new(rods, Caps::Flat).is_empty());
    }

    #[test]
    fn listed_bonds_go_to_the_nearest_images() {
        let positions = [[0.5, 1.0, 1.0], [5.0, 1.0, 1.0], [2.0, 1.0, 1.0]].map(Vec3::from_array);
        let mut frame = SharedFrame { bonds: vec![[0, 2], [1, 0]], ..frame_at(&positions) };
        let whole = listed(0.1, &frame).unwrap();
        let ends: Vec<[Vec3; 2]> = whole.iter().map(|rod| rod.ends).collect();
        assert_eq!(ends, [[positions[0], positions[2]], [positions[1], positions[0]]]);
        assert_eq!(whole[1].particles, [1, 0]);
        // The images of the cell of length 6 are nearer
        frame.cell = self::frame(1, [true; 3]).cell;
        let halves = listed(0.1, &frame).unwrap();
        let ends: Vec<[f32; 2]> = halves.iter().map(|rod| rod.ends.map(|end| end.x)).collect();
        assert_eq!(ends, [[0.5, 2.0], [5.0, 5.75], [0.5, -0.25]]);
        assert_eq!(halves[2].particles, [0, 0]);
        // Bonds of particles that do not exist are left out, and there are at most 8 per particle
        frame.bonds = vec![[0, 7]];
        assert_eq!(listed(0.1, &frame), Some(Vec::new()));
        frame.bonds = vec![[0, 1]; 25];
        assert_eq!(listed(0.1, &frame), None);
    }

    fn frame_at(positions: &[Vec3]) -> SharedFrame<'static> {
        SharedFrame {
            positions: positions.to_vec().into(),
            cell: None,
            bonds: Vec::new(),
            ..frame(positions.len(), [false; 3])
        }
    }
}
