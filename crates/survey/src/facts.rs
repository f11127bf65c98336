//! What one frame of a sequence says before any setting is resolved: which attributes it has and what they mean, its
//! cell, whether parts of it rest. `defaults` makes settings of it.

use std::collections::BTreeSet;

use glam::DVec3;
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    Attribute, AttributeData, FrameError, Labels, PositionSlice, Positions, RawParticles,
    SimulationCell, find_radius, names, sample_indices,
};

use super::aspherical::{ShapeSource, shape_source};
use super::beads::are_beads;
use super::gas::{Order, is_gas};
use super::grains::GrainRadius;
use super::packing::Spacing;
use super::robust::{robust_bounds, robust_range, sample_of, sorted_sample};
use super::sample::FrameSample;
use super::shape::{Axes, has_heavy_tails};
use super::sheet::covering_radius;
use super::solvent::hiding_water;

use super::tank::{Tank, tank_of};
use super::upright::up_of;
use super::walls::{Member, WallValues, walls};
use super::{Question, RadiusQuestion, RgbAttribute, velocity_of};

/// The attribute with atomic numbers.
pub const ELEMENT: &str = "element";

/// The attribute with the kinds of coarse-grained beads.
pub const BEAD: &str = "bead";

/// Names of attributes whose integers are categories, best first, in any spelling with the same [`kind_name`].
const CATEGORIES: [&str; 13] = [
    BEAD,
    "type",
    "ptype",
    "species",
    "element",
    "phase",
    "part",
    "material",
    "mk",
    "boundary",
    "is_boundary",
    "is_wall",
    "wall",
];

/// Most values of an attribute that are categories unasked: more colours cannot be told apart in a legend.
const MAX_CATEGORIES: usize = 12;

/// Number of particles from which the values of attributes are taken.
const SAMPLE: usize = 1 << 17;

/// An axis is flat if the particles extend along it by less than this part of their longest extent.
const FLAT: f64 = 1e-3;

/// Names of scalars by which particles without velocities are coloured, best first.
const SCALARS: [&str; 20] = [
    "temperature",
    "temp",
    "concentration",
    "pressure",
    "press",
    "p",
    "density",
    "rho",
    "rhop",
    "energy",
    "stress",
    "strain",
    "damage",
    "porosity",
    "saturation",
    "volume_fraction",
    "intensity",
    "charge",
    "b_factor",
    "value",
];

/// The largest atomic number.
const LAST_ELEMENT: i64 = 118;

/// See the module.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facts {
    /// Particle count.
    pub particles: usize,
    /// Whether there are velocities, and not all of them are zero.
    pub has_velocities: bool,
    /// Whether all particles have nearly the same speed.
    pub has_even_speed: bool,
    /// What colours particles without velocities: a velocity in a plane, or a scalar with a known name whose values differ.
    pub scalar: Option<String>,
    /// The axis at whose lower end the particles lie as on a floor, if it is not z.
    pub up: Option<DVec3>,
    /// Whether there is an attribute with colours.
    pub has_colors: bool,
    /// Whether there are radii.
    pub has_radii: bool,
    /// The radius of particles at random distances, whose nearest neighbours are much nearer than others: it follows from
    /// their density. Only without radii.
    pub random_radius: Option<f64>,
    /// An attribute with the radii of grains, under another name. Only plausible ones.
    pub grain_radius: Option<GrainRadius>,
    /// What gives particles shapes other than spheres.
    pub shape_source: Option<ShapeSource>,
    /// Walls that no attribute marks.
    pub tank: Option<Tank>,
    /// Whether most particles are near the middle of a cloud that has no end, such as a galaxy.
    pub has_heavy_tails: bool,
    /// The principal axes of the particles.
    pub axes: Option<Axes>,
    /// Whether the particles fill a box as a gas does, or a liquid without gravity.
    pub is_gas: bool,
    /// Whether the particles are groups of atoms with names like those of elements: they are farther apart than atoms.
    pub has_beads: bool,
    /// The radius with which spheres cover the plane or the surface in which the particles lie.
    pub covering_radius: Option<f64>,
    /// Whether there is a simulation time.
    pub has_time: bool,
    /// Whether the file lists bonds.
    pub has_bonds: bool,
    /// The chemical elements, if most particles are of one.
    pub elements: Option<Elements>,
    /// Attributes with few integers, best first.
    pub categories: Vec<Category>,
    /// Attributes of text: names of chains, residues and atoms.
    pub texts: Vec<String>,
    /// Names of residues of water that hides other molecules.
    pub hiding_water: Vec<String>,
    /// The simulation cell.
    pub cell: Option<SimulationCell>,
    /// The part of the particles that are in the cell, or near it.
    pub in_cell: f64,
    /// The part of each edge of the cell along which there are particles.
    pub cell_extent: [f64; 3],
    /// Corners of the box of the particles, without outliers, world units.
    pub bounds: Option<(DVec3, DVec3)>,
}

/// Chemical elements of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Elements {
    /// Whether some particles are of none, such as virtual sites.
    pub has_others: bool,
    /// Whether many are of metals or other elements of solids, whose atoms touch at their covalent radii.
    pub is_solid: bool,
}

/// An attribute with few integers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Category {
    /// Its name.
    pub name: String,
    /// Its values, rising.
    pub values: Vec<i64>,
    /// Those of walls, if there are some.
    pub walls: Option<WallValues>,
    /// The values without the particles that the first category with walls calls so, rising.
    pub without_walls: Vec<i64>,
    /// Those of its values whose particles do not move, while others do, rising.
    pub resting: Vec<i64>,
}

const QUESTION: Question<'static> =
    Question { radius: RadiusQuestion::AutoOfBody, ..Question::NOTHING };

impl Facts {
    /// The facts of the middle frame of `sequence`: the first one is often a lattice at rest. Nothing is known of a
    /// frame that cannot be read, which is reported later.
    pub fn of(sequence: &Sequence) -> Self {
        let count = sequence.frames().len();
        let place = FrameContext { is_only_frame: count == 1, angstrom: sequence.angstrom() };
        let read = |index: usize| FrameSample::of(sequence, index, (QUESTION, 1)).ok();
        let mut facts =
            read(count / 2).map_or_else(Self::default, |sample| Self::of_sample(&sample, place));
        // Of a single frame, a fluid or grains may be told from a model that was cut
        if count == 1 {
            facts.up = facts.up.filter(|_| facts.has_velocities);
        } else if facts.up.is_none() && facts.elements.is_none() && !sequence.is_y_up() {
            // Later, more of it lies on the floor
            facts.up = read(count - 1).and_then(|sample| Self::of_sample(&sample, place).up);
        }
        facts
    }

    /// The facts of particles in memory; `name` stands for their file.
    ///
    /// # Errors
    /// An attribute does not have all of its components for each particle.
    pub fn of_particles(
        name: &str,
        particles: &RawParticles<PositionSlice<'_>>,
    ) -> Result<Self, FrameError> {
        let sample = FrameSample::of_memory(name, particles, QUESTION)?;
        Ok(Self::of_sample(&sample, FrameContext { is_only_frame: true, angstrom: 1.0 }))
    }

    fn of_sample(sample: &FrameSample, place: FrameContext) -> Self {
        let raw = &sample.particles;
        let touching = sample.spacing.map(|spacing| f64::from(spacing.touching));
        let velocity = velocity_of(&raw.attributes);
        let integers = |name: &str| {
            let named = |a: &&Attribute| a.components == 1 && kind_name(&a.name) == kind_name(name);
            raw.attributes.iter().find(named)
        };
        let categories = CATEGORIES.iter().filter_map(|name| integers(name));
        let categories: Vec<Category> = categories.filter_map(|a| category(a, raw)).collect();
        // Atoms, or beads with names like theirs
        let element = integers(ELEMENT);
        let atoms = element.and_then(elements);
        let is_apart = |element: &Attribute| {
            sample.count >= MIN_RANDOM
                && touching.is_some_and(|touching| are_beads(element, touching / place.angstrom))
        };
        let has_beads =
            integers(BEAD).is_some() || (atoms.is_some() && element.is_some_and(is_apart));
        let elements = atoms.filter(|_| !has_beads);
        // Walls without an attribute of their own
        let is_periodic = raw.cell.as_ref().is_some_and(|cell| cell.periodic.contains(&true));
        let has_walls = categories.iter().any(|category| category.walls.is_some());
        let may_have_tank = elements.is_none() && !has_beads && !is_periodic && !has_walls;
        let tank = touching.filter(|_| may_have_tank);
        let positions = sample_of(&raw.positions);
        let velocities = velocities(velocity);
        let random_radius = sample.spacing.and_then(|spacing| random_radius(spacing, sample.count));
        Self {
            tank: tank.and_then(|touching| tank_of(sample, touching, place.is_only_frame)),
            grain_radius: touching.and_then(|touching| GrainRadius::of(&raw.attributes, touching)),
            covering_radius: touching
                .and_then(|touching| covering_radius(&positions, sample.count, touching)),
            shape_source: shape_source(raw),
            has_heavy_tails: has_heavy_tails(&positions),
            axes: Axes::of(&positions),
            is_gas: is_gas(
                &positions,
                sample.count,
                &velocities,
                order(sample.spacing, random_radius),
            ),
            has_beads,
            particles: sample.count,
            has_velocities: velocity.is_some_and(is_moving),
            has_even_speed: velocity.is_some_and(is_even),
            scalar: plane_velocity(&raw.attributes)
                .or_else(|| SCALARS.iter().find_map(|name| scalar(&raw.attributes, name)))
                .or_else(|| only_scalar(&raw.attributes)),
            up: up_of(&positions, sample.count, &velocities, DVec3::Z),
            has_colors: RgbAttribute::of(&raw.attributes, None).is_some(),
            has_radii: find_radius(&raw.attributes).is_some(),
            random_radius,
            has_time: raw.time.is_some(),
            has_bonds: !raw.bonds.is_empty(),
            elements,
            categories: without_walls(categories, &raw.attributes),
            texts: texts(&raw.labels),
            hiding_water: hiding_water(&raw.attributes, &raw.labels),
            in_cell: raw.cell.as_ref().map_or(0.0, |cell| part_in(cell, &raw.positions)),
            cell_extent: raw.cell.as_ref().map_or([0.0; 3], |cell| {
                let is_full = is_unit_cell(cell, sample.count, sample.spacing, place.angstrom);
                if is_full { [1.0; 3] } else { extent_in(cell, &raw.positions) }
            }),
            cell: raw.cell,
            bounds: robust_bounds(&raw.positions, sample.extremes).map(|bounds| bounds.outer),
        }
    }

    /// The axis along which the particles have no extent, if there is one: the data are two-dimensional.
    pub fn flat_axis(&self) -> Option<usize> {
        let (min, max) = self.bounds?;
        flat_axis(min, max)
    }
}

/// The columns of text among those with `labels`.
fn texts(labels: &Labels) -> Vec<String> {
    labels.keys().filter(|column| names::is_one_of(column, &names::TEXTS)).cloned().collect()
}

/// What is known of a frame beside its particles.
#[derive(Debug, Clone, Copy)]
struct FrameContext {
    /// Whether the sequence has no other frames.
    is_only_frame: bool,
    /// Length of an angstrom in the unit of the positions.
    angstrom: f64,
}

/// The axis along which a box has no extent, if it is a rectangle.
pub(super) fn flat_axis(min: DVec3, max: DVec3) -> Option<usize> {
    let extent = max - min;
    let least = FLAT * extent.max_element();
    let mut flat = (0..3).filter(|axis| extent[*axis] <= least);
    match (flat.next(), flat.next()) {
        (Some(axis), None) => Some(axis),
        _ => None,
    }
}

/// How far particles may be outside of a cell that contains them, as a part of its edges.
const MARGIN: f64 = 0.05;

/// Some of the particles in coordinates of `cell`: 0 to 1 along each edge; none in a cell without volume.
fn in_coordinates(cell: &SimulationCell, positions: &Positions) -> Vec<DVec3> {
    let Some(fractions) = cell.fractions() else {
        return Vec::new();
    };
    sample_of(positions).into_iter().map(|point| fractions * (point - cell.origin)).collect()
}

/// The part of the particles in `cell`, or within [`MARGIN`] of it.
fn part_in(cell: &SimulationCell, positions: &Positions) -> f64 {
    let is_inside = |at: &&DVec3| {
        at.cmpge(DVec3::splat(-MARGIN)).all() && at.cmple(DVec3::splat(1.0 + MARGIN)).all()
    };
    let sample = in_coordinates(cell, positions);
    let inside = sample.iter().filter(is_inside).count();
    #[expect(clippy::cast_precision_loss, reason = "a part of a sample")]
    let part = inside as f64 / sample.len().max(1) as f64;
    part
}

/// How much larger the radius that follows from the density is than half the distance of nearest neighbours, from which
/// on particles may be at random distances: it is 1.05 times as large in a lattice, 1.2 times in a fluid, and 1.5 times in
/// a sheet.
const RANDOM: f32 = 1.5;

/// The closest of a hundred neighbours of particles at random distances, relative to the median: 0.25 in a random cloud,
/// 0.5 in a gas of atoms, 1 in an even line or sheet.
const CLOSE: f32 = 0.4;

/// Fewest particles whose distances say something.
const MIN_RANDOM: usize = 100;

/// The radius of such particles in that of the density: they overlap a little.
const OVERLAPPING: f32 = 0.85;

/// See [`Facts::random_radius`].
fn random_radius(spacing: Spacing, count: usize) -> Option<f64> {
    let packed = spacing.packed.filter(|packed| *packed > RANDOM * spacing.touching)?;
    let is_random = spacing.closest < CLOSE * spacing.touching && count >= MIN_RANDOM;
    is_random.then(|| (OVERLAPPING * packed).into())
}

/// The closest of a hundred neighbours, relative to the median, up to which particles are no lattice.
const UNEVEN: f32 = 0.97;

/// How the places of particles with this `spacing` are related.
fn order(spacing: Option<Spacing>, random_radius: Option<f64>) -> Order {
    match (random_radius, spacing) {
        (Some(_), _) => Order::Random,
        (None, Some(spacing)) if spacing.closest < UNEVEN * spacing.touching => Order::Liquid,
        _ => Order::Lattice,
    }
}

/// The part of each edge of `cell` along which there are particles, without a few outliers.
fn extent_in(cell: &SimulationCell, positions: &Positions) -> [f64; 3] {
    let sample = in_coordinates(cell, positions);
    [0, 1, 2].map(|axis| {
        let along = sorted_sample(sample.len(), |i| sample[i][axis]);
        robust_range(&along).map_or(0.0, |(low, high)| high - low)
    })
}

/// Number of particles below which the layers of a crystal do not extend along the edges of its cell.
const FEW: usize = 100;

/// The smallest distance of nearest neighbours in a cell that a few atoms fill, relative to that of a cubic lattice: those
/// of a molecule in a large cell are nearer.
const CUBIC: f64 = 0.5;

/// The longest edge of a cell that one atom fills, in angstroms.
const LONE: f64 = 10.0;

/// Whether a few particles fill a periodic `cell`, as those of a unit cell do: the cell has about the volume that they
/// need at the distance of nearest neighbours.
fn is_unit_cell(
    cell: &SimulationCell,
    count: usize,
    spacing: Option<Spacing>,
    angstrom: f64,
) -> bool {
    let [a, b, c] = cell.vectors;
    #[expect(clippy::cast_precision_loss, reason = "a few")]
    let cubic = libm::cbrt(a.cross(b).dot(c).abs() / count.max(1) as f64);
    let lone = if cubic <= LONE * angstrom { cubic } else { 0.0 };
    let nearest = spacing.map_or(lone, |spacing| 2.0 * f64::from(spacing.touching));
    count > 0 && count < FEW && cell.periodic == [true; 3] && nearest >= CUBIC * cubic
}

/// Whether a particle of a sample moves.
fn is_moving(velocity: &Attribute) -> bool {
    sample_indices(velocity.count(), SAMPLE).any(|i| velocity.magnitude(i) != 0.0)
}

/// The range of speeds, as a part of the largest, below which they say nothing.
const EVEN: f64 = 0.1;

/// Whether all particles of a sample are nearly as fast.
fn is_even(velocity: &Attribute) -> bool {
    let speeds = sorted_sample(velocity.count(), |i| velocity.magnitude(i));
    robust_range(&speeds).is_some_and(|(low, high)| high > 0.0 && high - low < EVEN * high)
}

/// Velocities of some particles, if there are finite ones.
fn velocities(velocity: Option<&Attribute>) -> Vec<DVec3> {
    let Some(velocity) = velocity else { return Vec::new() };
    let vector = |i: usize| DVec3::from_array([0, 1, 2].map(|c| velocity.data.get_f64(3 * i + c)));
    let sample = sample_indices(velocity.count(), super::robust::SAMPLE).map(vector);
    sample.filter(|v| v.is_finite()).collect()
}

/// The name of a velocity in a plane, which has two components, if it is not zero everywhere.
fn plane_velocity(attributes: &[Attribute]) -> Option<String> {
    let is_velocity =
        |a: &&Attribute| a.components == 2 && names::is_one_of(&a.name, &names::VELOCITY);
    attributes
        .iter()
        .find(is_velocity)
        .filter(|a| is_moving(a) && !is_even(a))
        .map(|a| a.name.clone())
}

/// The name of the scalar `name` among `attributes`, if its values differ.
fn scalar(attributes: &[Attribute], name: &str) -> Option<String> {
    let named = |a: &&Attribute| a.components == 1 && a.name.eq_ignore_ascii_case(name);
    let found = attributes.iter().find(named)?;
    let values = sorted_sample(found.count(), |i| found.data.get_f64(i));
    let (low, high) = robust_range(&values)?;
    (low < high).then(|| found.name.clone())
}

/// Names of scalars that do not tell anything of a particle, as far as colours go.
const DULL: [&str; 12] = [
    "mass",
    "m",
    "masses",
    "h",
    "hsml",
    "smoothing_length",
    "volume",
    "vol",
    "time",
    "step",
    "index",
    "id",
];

/// The name of the only scalar with real numbers that differ, if there is one alone.
fn only_scalar(attributes: &[Attribute]) -> Option<String> {
    let is_dull = |name: &str| {
        names::is_radius_name(name)
            || GrainRadius::is_name(name)
            || DULL.iter().any(|dull| dull.eq_ignore_ascii_case(name))
    };
    let is_real = |a: &&Attribute| {
        a.components == 1 && matches!(a.data, AttributeData::F32(_) | AttributeData::F64(_))
    };
    let mut real = attributes.iter().filter(is_real).filter(|a| !is_dull(&a.name));
    let only = real.next().filter(|_| real.next().is_none())?;
    scalar(attributes, &only.name)
}

/// The name of a category without what programs add to it: `typeIds`, `type_id` and `particle_type` are `type`.
fn kind_name(name: &str) -> String {
    let name = name.to_ascii_lowercase().replace(['_', '-'], "");
    let name = name.strip_prefix("particle").unwrap_or(&name);
    let without = |name: &str, endings: &[&str]| {
        let stem = endings.iter().find_map(|ending| name.strip_suffix(ending));
        stem.filter(|stem| !stem.is_empty()).unwrap_or(name).to_owned()
    };
    without(&without(name, &["ids", "id"]), &["s"])
}

/// The values of `attribute` for some particles, with their indices.
fn values(attribute: &Attribute) -> impl Iterator<Item = (usize, f64)> + '_ {
    sample_indices(attribute.count(), SAMPLE).map(|i| (i, attribute.data.get_f64(i)))
}

/// Atomic numbers of the elements of molecules and noble gases.
const MOLECULAR: [i64; 14] = [1, 2, 6, 7, 8, 9, 10, 15, 16, 17, 18, 35, 36, 53];

/// The part of all particles that others have in a solid.
const SOLID: f64 = 0.1;

/// The elements in `attribute`, if most particles have one.
#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "small numbers")]
fn elements(attribute: &Attribute) -> Option<Elements> {
    let (mut known, mut solid, mut all) = (0_usize, 0_usize, 0_usize);
    for (_, value) in values(attribute) {
        let is_known = value >= 1.0 && value <= LAST_ELEMENT as f64;
        all += 1;
        known += usize::from(is_known);
        solid += usize::from(is_known && !MOLECULAR.contains(&(value as i64)));
    }
    let is_solid = solid as f64 > SOLID * all as f64;
    (2 * known > all).then_some(Elements { has_others: known < all, is_solid })
}

/// The categories in `attribute` of `particles`, if its values are few integers, and more than one.
fn category(attribute: &Attribute, particles: &RawParticles) -> Option<Category> {
    let velocity = velocity_of(&particles.attributes);
    let mut all = BTreeSet::new();
    let mut members = Vec::new();
    for (index, value) in values(attribute) {
        if value.fract() != 0.0 || value.abs() > 1e15 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "an integer within the range")]
        let value = value as i64;
        all.insert(value);
        if all.len() > MAX_CATEGORIES {
            return None;
        }
        let is_moving = velocity.is_some_and(|v| v.count() > index && v.magnitude(index) != 0.0);
        let position = particles.positions.get(index);
        members.push(Member { value, position, is_moving });
    }
    let moving: BTreeSet<i64> =
        members.iter().filter(|member| member.is_moving).map(|member| member.value).collect();
    let resting = all.difference(&moving).filter(|_| !moving.is_empty()).copied().collect();
    (all.len() > 1).then(|| Category {
        name: attribute.name.clone(),
        values: all.iter().copied().collect(),
        resting,
        walls: walls(&attribute.name, &particles.attributes, &members),
        without_walls: all.into_iter().collect(),
    })
}

/// Finds the values of `categories` without the walls of the first one that has some.
fn without_walls(mut categories: Vec<Category>, attributes: &[Attribute]) -> Vec<Category> {
    let named = |name: &str| attributes.iter().find(|a| a.name == name);
    let found = categories.iter().find_map(|c| Some((named(&c.name)?, c.walls.as_ref()?)));
    let Some((of, walls)) = found.map(|(of, walls)| (of, walls.values.clone())) else {
        return categories;
    };
    #[expect(clippy::cast_precision_loss, reason = "small integers")]
    let is_wall = |index: usize| walls.iter().any(|wall| *wall as f64 == of.data.get_f64(index));
    for category in &mut categories {
        let Some(attribute) = named(&category.name) else { continue };
        let kept = values(attribute).filter(|(index, _)| !is_wall(*index));
        #[expect(clippy::cast_possible_truncation, reason = "integers within the range")]
        let kept: BTreeSet<i64> = kept.map(|(_, value)| value as i64).collect();
        category.without_walls = kept.into_iter().collect();
    }
    categories
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn categories_have_many_names() {
        for name in ["type", "typeId", "type_ids", "Types", "particle_type"] {
            assert_eq!(kind_name(name), kind_name("type"), "{name}");
        }
        assert_eq!(kind_name("material_id"), kind_name("material"));
        assert_eq!(kind_name("Species"), kind_name("species_id"));
        assert_ne!(kind_name("id"), kind_name("type"));
        assert_ne!(kind_name("prototype"), kind_name("type"));
    }

    #[test]
    fn a_scalar_alone_means_something() {
        let scalar = |name: &str, values: Vec<f32>| Attribute {
            name: name.to_owned(),
            components: 1,
            data: AttributeData::F32(values),
        };
        let differing = || (0_u8..100).map(f32::from).collect::<Vec<f32>>();
        let [damage, mass, radius] = ["c_1", "mass", "r"].map(|name| scalar(name, differing()));
        let all = [mass.clone(), damage.clone(), radius];
        assert_eq!(only_scalar(&all).as_deref(), Some("c_1"));
        assert_eq!(only_scalar(&[damage.clone(), scalar("c_2", differing())]), None);
        assert_eq!(only_scalar(&[scalar("c_1", vec![2.0; 100])]), None);
        assert_eq!(only_scalar(&[mass]), None);
    }

    #[test]
    fn speeds_that_are_alike_say_nothing() {
        let of = |speeds: [f32; 3]| {
            let data = speeds.iter().flat_map(|speed| [0.0, *speed, 0.0]).collect();
            let data = AttributeData::F32(data);
            is_even(&Attribute { name: "velocity".to_owned(), components: 3, data })
        };
        assert!(of([0.5, 0.51, 0.5]) && !of([0.0, 0.51, 0.5]) && !of([0.0; 3]));
    }

    #[test]
    fn unit_cells_are_full_and_cells_around_a_molecule_are_not() {
        let cell = |edge: f64| {
            SimulationCell::new(DVec3::ZERO, DVec3::AXES.map(|axis| edge * axis), [true; 3])
                .expect("a cell")
        };
        let nearest = |distance: f32| {
            let touching = 0.5 * distance;
            Some(Spacing { touching, closest: touching, packed: None })
        };
        // Polonium, copper, rock salt, and an atom in a large cell
        assert!(!is_unit_cell(&cell(40.0), 1, None, 1.0));
        assert!(is_unit_cell(&cell(3.35), 1, None, 1.0));
        assert!(is_unit_cell(&cell(3.61), 4, nearest(2.55), 1.0));
        assert!(is_unit_cell(&cell(5.64), 8, nearest(2.82), 1.0));
        // A diatomic molecule in a box, and many particles
        assert!(!is_unit_cell(&cell(9.0), 2, nearest(1.0), 1.0));
        assert!(!is_unit_cell(&cell(100.0), 1000, nearest(10.0), 1.0));
    }
}
