//! What one frame of a sequence says before any setting is resolved: which attributes it has and what they mean, its
//! cell, whether parts of it rest. `defaults` makes settings of it.

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};
use spherule_formats::sequence::Sequence;
use spherule_formats::{
    Attribute, FrameError, PositionSlice, Positions, RawParticles, SimulationCell, find_radius,
    sample_indices,
};

use super::robust::{robust_bounds, sample_of};
use super::sample::FrameSample;
use super::{ColorQuestion, Fit, Question, RadiusQuestion, RgbAttribute, velocity_of};

/// The attribute with atomic numbers.
pub const ELEMENT: &str = "element";

/// Names of attributes whose integers are categories, best first.
const CATEGORIES: [&str; 8] =
    ["type", "typeid", "species", "element", "phase", "part", "material", "mk"];

/// Most values of an attribute that are categories unasked: more colours cannot be told apart in a legend.
const MOST_CATEGORIES: usize = 12;

/// Number of particles from which the values of attributes are taken.
const SAMPLE: usize = 1 << 17;

/// An axis is flat if the particles extend along it by less than this part of their longest extent.
const FLAT: f64 = 1e-3;

/// The largest atomic number.
const LAST_ELEMENT: i64 = 118;

/// See the module.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facts {
    /// Particle count.
    pub particles: usize,
    /// Whether there are velocities.
    pub has_velocities: bool,
    /// Whether there is an attribute with colours.
    pub has_colors: bool,
    /// Whether there are radii.
    pub has_radii: bool,
    /// Whether there is a simulation time.
    pub has_time: bool,
    /// Whether the file lists bonds.
    pub has_bonds: bool,
    /// The chemical elements, if most particles are of one.
    pub elements: Option<Elements>,
    /// Attributes with few integers, best first.
    pub categories: Vec<Category>,
    /// The simulation cell.
    pub cell: Option<SimulationCell>,
    /// The part of the particles that are in the cell, or near it.
    pub in_cell: f64,
    /// Corners of the box of the particles, without outliers, world units.
    pub bounds: Option<(DVec3, DVec3)>,
}

/// Chemical elements of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Elements {
    /// Whether some particles are of none, such as virtual sites.
    pub has_others: bool,
}

/// An attribute with few integers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Category {
    /// Its name.
    pub name: String,
    /// Its values, rising.
    pub values: Vec<i64>,
    /// Those whose particles all rest while most of the others move, rising.
    pub at_rest: Vec<i64>,
}

const QUESTION: Question<'static> = Question {
    color: ColorQuestion::None,
    radius: RadiusQuestion::None,
    up: None,
    points: false,
    selection: None,
    fit: Fit::All,
    framed: None,
};

impl Facts {
    /// The facts of the middle frame of `sequence`: the first one is often a lattice at rest. Nothing is known of a
    /// frame that cannot be read, which is reported later.
    pub fn of(sequence: &Sequence) -> Self {
        let index = sequence.frames().len() / 2;
        let sample = FrameSample::of(sequence, index, (QUESTION, 1));
        sample.map_or_else(|_| Self::default(), |sample| Self::of_sample(&sample))
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
        Ok(Self::of_sample(&sample))
    }

    fn of_sample(sample: &FrameSample) -> Self {
        let raw = &sample.particles;
        let velocity = velocity_of(&raw.attributes);
        let integers = |name: &str| {
            let named = |a: &&Attribute| a.components == 1 && a.name.eq_ignore_ascii_case(name);
            raw.attributes.iter().find(named)
        };
        let categories = CATEGORIES.iter().filter_map(|name| integers(name));
        Self {
            particles: sample.count,
            has_velocities: velocity.is_some(),
            has_colors: RgbAttribute::of(&raw.attributes, None).is_some(),
            has_radii: find_radius(&raw.attributes).is_some(),
            has_time: raw.time.is_some(),
            has_bonds: !raw.bonds.is_empty(),
            elements: integers(ELEMENT).and_then(elements),
            categories: categories.filter_map(|a| category(a, velocity)).collect(),
            in_cell: raw.cell.as_ref().map_or(0.0, |cell| part_in(cell, &raw.positions)),
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

/// The part of the particles in `cell`, or within [`MARGIN`] of it.
fn part_in(cell: &SimulationCell, positions: &Positions) -> f64 {
    let [a, b, c] = cell.vectors;
    let to_edges = DMat3::from_cols(a, b, c);
    if to_edges.determinant() == 0.0 {
        return 0.0;
    }
    let inverse = to_edges.inverse();
    let is_inside = |point: DVec3| {
        let at = inverse * (point - cell.origin);
        at.cmpge(DVec3::splat(-MARGIN)).all() && at.cmple(DVec3::splat(1.0 + MARGIN)).all()
    };
    let sample = sample_of(positions);
    let inside = sample.iter().filter(|point| is_inside(**point)).count();
    #[expect(clippy::cast_precision_loss, reason = "a part of a sample")]
    let part = inside as f64 / sample.len().max(1) as f64;
    part
}

/// The values of `attribute` for some particles, with their indices.
fn values(attribute: &Attribute) -> impl Iterator<Item = (usize, f64)> + '_ {
    sample_indices(attribute.count(), SAMPLE).map(|i| (i, attribute.data.get_f64(i)))
}

/// The elements in `attribute`, if most particles have one.
fn elements(attribute: &Attribute) -> Option<Elements> {
    let (mut known, mut all) = (0_usize, 0_usize);
    for (_, value) in values(attribute) {
        all += 1;
        known += usize::from(value >= 1.0 && value <= LAST_ELEMENT as f64);
    }
    (2 * known > all).then_some(Elements { has_others: known < all })
}

/// The categories in `attribute`, if its values are few integers, and more than one.
fn category(attribute: &Attribute, velocity: Option<&Attribute>) -> Option<Category> {
    let mut all = BTreeSet::new();
    let mut moving = BTreeSet::new();
    for (index, value) in values(attribute) {
        if value.fract() != 0.0 || value.abs() > 1e15 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "an integer within the range")]
        let value = value as i64;
        all.insert(value);
        if all.len() > MOST_CATEGORIES {
            return None;
        }
        if velocity.is_some_and(|v| v.count() > index && v.magnitude(index) != 0.0) {
            moving.insert(value);
        }
    }
    let at_rest =
        if moving.is_empty() { Vec::new() } else { all.difference(&moving).copied().collect() };
    (all.len() > 1).then(|| Category {
        name: attribute.name.clone(),
        values: all.into_iter().collect(),
        at_rest,
    })
}
