//! Particles near others: `within 5 of (residue == 'LIG')`.

use std::collections::HashMap;

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use spherule_frame::{RawParticles, SimulationCell};

/// Which of `particles` are up to a `distance` from one that is marked in `of`, itself included. In a periodic cell, also
/// from its images.
pub(super) fn near(particles: &RawParticles, distance: f64, of: &[bool]) -> Vec<bool> {
    let position = |index: usize| particles.positions.get(index);
    // Sort the marked ones into cubes with edges as long as the distance
    let marked = (0..of.len()).filter(|index| of[*index]).map(position);
    let bins = Bins::new(distance, marked.filter(|point| point.is_finite()));
    let images = particles.cell.as_ref().map(SimulationCell::images_around).unwrap_or_default();
    let images: Vec<DVec3> = images.iter().map(|image| image.as_dvec3()).collect();
    // Search the cubes around each particle, and around its images
    let is_near = |index: usize| {
        let point = position(index);
        of[index]
            || point.is_finite()
                && (bins.has_near(point) || images.iter().any(|image| bins.has_near(point + image)))
    };
    (0..of.len()).into_par_iter().map(is_near).collect()
}

/// Points in cubes.
struct Bins {
    distance: f64,
    /// The box that contains all points within the distance.
    bounds: [DVec3; 2],
    cubes: HashMap<IVec3, Vec<DVec3>>,
}

impl Bins {
    fn new(distance: f64, points: impl Iterator<Item = DVec3>) -> Self {
        let mut bins = Self {
            distance,
            bounds: [DVec3::INFINITY, DVec3::NEG_INFINITY],
            cubes: HashMap::new(),
        };
        for point in points {
            let [min, max] = bins.bounds;
            bins.bounds = [min.min(point - distance), max.max(point + distance)];
            bins.cubes.entry(bins.cube(point)).or_default().push(point);
        }
        bins
    }

    /// The cube of a point; points far away share those at the end.
    fn cube(&self, point: DVec3) -> IVec3 {
        (point / self.distance).floor().as_ivec3()
    }

    fn has_near(&self, point: DVec3) -> bool {
        let [min, max] = self.bounds;
        if !(point.cmpge(min).all() && point.cmple(max).all()) {
            return false;
        }
        let cube = self.cube(point);
        let steps = || -1..=1_i32;
        let around = steps()
            .flat_map(|x| steps().flat_map(move |y| steps().map(move |z| IVec3::new(x, y, z))));
        around.filter_map(|step| self.cubes.get(&cube.saturating_add(step))).any(|points| {
            points
                .iter()
                .any(|other| other.distance_squared(point) <= self.distance * self.distance)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Condition, Selection};
    use spherule_frame::{Attribute, AttributeData, Positions};

    /// Particles at random places in a box of size 10, every tenth of type 1.
    fn particles(periodic: bool) -> RawParticles {
        let mut state = 3_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / 16_777_216.0
        };
        let points = (0..600).map(|_| 10.0 * DVec3::new(next(), next(), next())).collect();
        let edges = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| 10.0 * axis);
        RawParticles {
            positions: Positions::F64(points),
            attributes: vec![Attribute {
                name: "type".to_owned(),
                components: 1,
                data: AttributeData::I32((0..600).map(|i| i32::from(i % 10 == 0)).collect()),
            }],
            cell: SimulationCell::new(DVec3::ZERO, edges, [periodic; 3]),
            ..RawParticles::default()
        }
    }

    #[test]
    fn all_particles_within_the_distance_are_found() {
        for periodic in [false, true] {
            let particles = particles(periodic);
            let condition = Condition::parse("within 1.5 of (type == 1) && type == 0").unwrap();
            let selection = Selection { condition: Some(condition), ..Selection::default() };
            let found = selection.survivors(&particles).unwrap();
            let points: Vec<DVec3> = (0..600).map(|i| particles.positions.get(i)).collect();
            let is_near = |a: DVec3, b: DVec3| {
                let offset = (a - b).abs();
                let offset = if periodic { offset.min(10.0 - offset) } else { offset };
                offset.length() <= 1.5
            };
            let has_near = |i: u32| {
                let others = (0..600).step_by(10).map(|other| points[other]);
                !i.is_multiple_of(10)
                    && others.into_iter().any(|other| is_near(points[i as usize], other))
            };
            let expected: Vec<u32> = (0..600).filter(|i| has_near(*i)).collect();
            assert_eq!(found, expected);
            assert!(expected.len() > 100 && expected.len() < 540);
        }
    }

    #[test]
    fn conditions_may_be_nested() {
        let particles = particles(false);
        let survivors = |text: &str| {
            let condition = Some(Condition::parse(text).unwrap());
            Selection { condition, ..Selection::default() }.survivors(&particles).unwrap()
        };
        let twice = survivors("within 1 of (within 1 of (type == 1))");
        let once = survivors("within 1 of (type == 1)");
        assert!(once.len() < twice.len());
        assert_eq!(survivors("within 0.5 of (x > 100)"), Vec::<u32>::new());
        assert_eq!(survivors("!(within 30 of (type == 1))"), Vec::<u32>::new());
    }

    #[test]
    fn joined_conditions_are_those_of_the_joined_text() {
        let particles = particles(true);
        let parsed = |text: &str| Condition::parse(text).unwrap();
        let survivors = |condition: Condition| {
            let condition = Some(condition);
            Selection { condition, ..Selection::default() }.survivors(&particles).unwrap()
        };
        let near = parsed("within 1 of (type == 1 && x > 3)");
        let joined = [
            near.clone().negated().and(parsed("type == 0 || y < 2").or(near.clone())),
            parsed("z > 8").or(near.clone().and(parsed("type == 0").negated())),
            parsed("type in (1, 7)").and(parsed("x > 1")).negated(),
        ];
        for condition in joined {
            let text = condition.as_str().to_owned();
            let found = survivors(condition);
            assert_eq!(found, survivors(parsed(&text)), "{text}");
            assert!(!found.is_empty() && found.len() < 600, "{text}");
        }
        // No limit of the text applies
        let all = (0..200).fold(parsed("x < 0"), |all, _| parsed("z > 8").or(all));
        assert_eq!(survivors(all), survivors(parsed("z > 8")));
    }

    #[test]
    fn errors_name_the_character() {
        for (text, column, what) in [
            ("within 5 (type == 1)", 10, "expected `of`"),
            ("within 5 of type == 1", 13, "expected `(`"),
            ("within 5 of (x)", 14, "needs a condition"),
            ("within 0 of (x > 1)", 8, "a distance above 0"),
            ("within 5 of (x > 1", 19, "expected `)`"),
        ] {
            let error = Condition::parse(text).unwrap_err();
            assert!(
                error.to_string().contains(what) && error.column == column,
                "{text}: {error:?}"
            );
        }
        // It is a name where no number follows
        assert!(Condition::parse("within > 5").is_ok());
    }
}
