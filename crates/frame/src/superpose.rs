//! Frames turned so that a group of particles is where it was in another frame, as nearly as possible: the rotation of
//! least squares (Horn, "Closed-form solution of absolute orientation using unit quaternions", Journal of the Optical
//! Society of America A 4, 1987).

use glam::{DMat3, DQuat, DVec3, Vec3};

use crate::grain_columns::{GrainColumns, is_size};
use crate::names::{COLOR, is_one_of};
use crate::values::id_of;
use crate::{Attribute, AttributeData, ParseError, RawParticles, SimulationCell};

/// A group is on a line if all of it is within this part of its extent.
const MIN_WIDTH: f64 = 1e-5;

/// Most rounds of Jacobi's method; it converges in less than ten.
const MAX_ROUNDS: usize = 50;

/// The places of a group of particles in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupPlaces {
    /// By rising id, or in the order of the file without ids.
    places: Vec<DVec3>,
    /// Empty without ids.
    ids: Vec<f64>,
}

impl GroupPlaces {
    /// The places of the `chosen` particles, by their ids if they have some.
    pub fn of(particles: &RawParticles, chosen: &[u32]) -> Self {
        let mut order = chosen.to_vec();
        let attribute = id_of(&particles.attributes);
        let id = |index: &u32| attribute.map_or(0.0, |ids| ids.data.get_f64(*index as usize));
        order.sort_by(|a, b| id(a).total_cmp(&id(b)));
        Self {
            places: order.iter().map(|index| particles.positions.get(*index as usize)).collect(),
            ids: attribute.map_or(Vec::new(), |_| order.iter().map(id).collect()),
        }
    }

    /// The rotation of least squares, which superposes this group on the same one elsewhere.
    ///
    /// # Errors
    /// The groups have other particles, fewer than three of them, or only some on a line.
    fn onto(&self, reference: &Self) -> Result<Superposition, ParseError> {
        // Match the particles
        let counts = [self.places.len(), reference.places.len()];
        if counts[0] != counts[1] {
            return Err(ParseError::unsupported(format!(
                "cell.align takes {} particles here, but {} in the first frame; take a condition that holds for the \
                 same particles in all frames",
                counts[0], counts[1]
            )));
        }
        if self.ids.len() == reference.ids.len()
            && let Some((id, _)) = self.ids.iter().zip(&reference.ids).find(|(a, b)| a != b)
        {
            return Err(ParseError::unsupported(format!(
                "cell.align takes other particles than in the first frame, such as that with id {id}; take a condition \
                 that holds for the same particles in all frames"
            )));
        }
        let pairs = self.places.iter().copied().zip(reference.places.iter().copied());
        let pairs: Vec<(DVec3, DVec3)> =
            pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).collect();
        // Move both to their centres
        let (from, to) = unzip_centered(&pairs)?;
        let from_center = from.center;
        let sums =
            from.offsets.iter().zip(&to.offsets).fold(DMat3::ZERO, |sum, (a, b)| {
                sum + DMat3::from_cols(b.x * *a, b.y * *a, b.z * *a)
            });
        Ok(Superposition { rotation: rotation_of(sums), from: from_center, to: to.center })
    }
}

/// A group around its centre.
struct Centered {
    center: DVec3,
    offsets: Vec<DVec3>,
}

impl Centered {
    fn of(places: impl Iterator<Item = DVec3> + Clone, count: f64) -> Result<Self, ParseError> {
        let center = places.clone().sum::<DVec3>() / count;
        let offsets: Vec<DVec3> = places.map(|place| place - center).collect();
        // Refuse a line, about which any rotation would do
        let farthest = offsets.iter().copied().fold(DVec3::ZERO, |far, offset| {
            if offset.length_squared() > far.length_squared() { offset } else { far }
        });
        let direction = farthest.normalize_or_zero();
        let width = offsets.iter().map(|offset| offset.reject_from_normalized(direction).length());
        let is_line =
            farthest == DVec3::ZERO || width.fold(0.0, f64::max) <= MIN_WIDTH * farthest.length();
        if is_line {
            return Err(ParseError::unsupported(
                "cell.align takes particles on a line, which define no rotation; take more of them",
            ));
        }
        Ok(Self { center, offsets })
    }
}

/// Both groups of pairs, around their centres.
fn unzip_centered(pairs: &[(DVec3, DVec3)]) -> Result<(Centered, Centered), ParseError> {
    if pairs.len() < 3 {
        return Err(ParseError::unsupported(format!(
            "cell.align takes {} particles with finite positions; a rotation needs at least 3",
            pairs.len()
        )));
    }
    let count = pairs.len() as f64;
    let from = Centered::of(pairs.iter().map(|(from, _)| *from), count)?;
    Ok((from, Centered::of(pairs.iter().map(|(_, to)| *to), count)?))
}

/// A rotation about a point, which then moves to another one.
#[derive(Debug, Clone, Copy)]
struct Superposition {
    rotation: DMat3,
    from: DVec3,
    to: DVec3,
}

impl Superposition {
    fn place(&self, place: DVec3) -> DVec3 {
        self.rotation * (place - self.from) + self.to
    }
}

/// Turns and moves `particles` so that the `chosen` ones are where `reference` has them, with their cell and all vectors:
/// attributes of three floating-point numbers that are not colours or sizes. Adds a note if grains have orientations, which do not
/// turn.
///
/// # Errors
/// The chosen particles are not those of the reference, fewer than three, or on a line.
pub fn superpose(
    particles: &mut RawParticles,
    chosen: &[u32],
    reference: &GroupPlaces,
) -> Result<(), ParseError> {
    let superposition = GroupPlaces::of(particles, chosen).onto(reference)?;
    particles.positions.each(|position| superposition.place(position));
    if let Some(cell) = &particles.cell {
        let vectors = cell.vectors.map(|edge| superposition.rotation * edge);
        let origin = superposition.place(cell.origin);
        particles.cell = Some(SimulationCell { origin, vectors, ..*cell });
    }
    for attribute in particles.attributes.iter_mut().filter(|attribute| is_vector(attribute)) {
        turn(attribute, superposition.rotation);
    }
    let grains = GrainColumns::find(&particles.attributes);
    if grains.is_some_and(|grains| !grains.orientations.is_empty()) {
        particles.notes.push("cell.align does not turn the orientations of grains".to_owned());
    }
    Ok(())
}

/// Attributes of three numbers along the axes of a particle: those of GSD.
const BODY_VECTORS: [&str; 1] = ["moment_inertia"];

/// Whether an attribute has directions in space.
fn is_vector(attribute: &Attribute) -> bool {
    let is_float = matches!(attribute.data, AttributeData::F32(_) | AttributeData::F64(_));
    let name = &attribute.name;
    let is_other = is_one_of(name, &COLOR) || is_one_of(name, &BODY_VECTORS) || is_size(name);
    attribute.components == 3 && is_float && !is_other
}

/// Turns the vectors of an attribute.
fn turn(attribute: &mut Attribute, rotation: DMat3) {
    match &mut attribute.data {
        AttributeData::F32(numbers) => {
            for vector in numbers.chunks_exact_mut(3) {
                let turned = rotation * Vec3::from_slice(vector).as_dvec3();
                turned.as_vec3().write_to_slice(vector);
            }
        }
        AttributeData::F64(numbers) => {
            for vector in numbers.chunks_exact_mut(3) {
                (rotation * DVec3::from_slice(vector)).write_to_slice(vector);
            }
        }
        _ => {}
    }
}

/// The rotation with the largest sum of products of turned places and those of the reference; `sums` has the sums of
/// their products, by the axis of the places (row) and of the reference (column).
fn rotation_of(sums: DMat3) -> DMat3 {
    let s = |row: usize, column: usize| sums.col(column)[row];
    let (xx, yy, zz) = (s(0, 0), s(1, 1), s(2, 2));
    let matrix = [
        [xx + yy + zz, s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0)],
        [s(1, 2) - s(2, 1), xx - yy - zz, s(0, 1) + s(1, 0), s(2, 0) + s(0, 2)],
        [s(2, 0) - s(0, 2), s(0, 1) + s(1, 0), yy - xx - zz, s(1, 2) + s(2, 1)],
        [s(0, 1) - s(1, 0), s(2, 0) + s(0, 2), s(1, 2) + s(2, 1), zz - xx - yy],
    ];
    let [w, x, y, z] = largest_eigenvector(matrix);
    DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
}

/// The eigenvector of a symmetric matrix with the largest eigenvalue, by Jacobi's method.
fn largest_eigenvector(mut matrix: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..MAX_ROUNDS {
        let mut is_diagonal = true;
        for (p, q) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let sum = matrix[p][p].abs() + matrix[q][q].abs();
            if sum + matrix[p][q].abs() == sum {
                continue;
            }
            is_diagonal = false;
            // The rotation in the plane of p and q that makes their element zero
            let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
            let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cosine = (tangent * tangent + 1.0).sqrt().recip();
            let sine = tangent * cosine;
            for row in &mut matrix {
                (row[p], row[q]) =
                    (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
            }
            let (first, second) = (matrix[p], matrix[q]);
            matrix[p] = std::array::from_fn(|k| cosine * first[k] - sine * second[k]);
            matrix[q] = std::array::from_fn(|k| sine * first[k] + cosine * second[k]);
            for row in &mut vectors {
                (row[p], row[q]) =
                    (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
            }
        }
        if is_diagonal {
            break;
        }
    }
    let largest =
        (1..4).fold(0, |best, i| if matrix[i][i] > matrix[best][best] { i } else { best });
    vectors.map(|row| row[largest])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Positions;

    /// Eleven places without a symmetry.
    fn places() -> Vec<DVec3> {
        let place = |i: u32| {
            let i = f64::from(i);
            DVec3::new(3.0 + i * 1.25 % 2.0, i * i * 0.75 % 3.0, 5.0 - i * 1.75 % 4.5)
        };
        (0..11).map(place).collect()
    }

    fn particles(places: Vec<DVec3>) -> RawParticles {
        let count = places.len();
        let speeds: Vec<f32> = (0..count).flat_map(|_| [1.0, 0.0, 0.0]).collect();
        let vectors = |name: &str, data| Attribute { name: name.to_owned(), components: 3, data };
        RawParticles {
            positions: Positions::F64(places),
            attributes: vec![
                vectors("velocity", AttributeData::F32(speeds.clone())),
                vectors("color", AttributeData::F32(speeds.clone())),
                vectors("force", AttributeData::F64([0.0, 2.0, 0.0].repeat(count))),
                vectors("AsphericalShape", AttributeData::F32(speeds)),
            ],
            cell: SimulationCell::new(DVec3::ONE, [DVec3::X, DVec3::Y, DVec3::Z], [true; 3]),
            ..RawParticles::default()
        }
    }

    const GROUP: [u32; 5] = [0, 2, 3, 7, 9];

    #[test]
    fn a_turned_group_turns_back() {
        let reference = GroupPlaces::of(&particles(places()), &GROUP);
        // Small, large and half turns
        for (axis, angle) in [
            (DVec3::X, 1e-6),
            (DVec3::new(1.0, -2.0, 3.0), 2.0),
            (DVec3::Y, std::f64::consts::PI),
            (DVec3::new(-1.0, 0.5, 0.0), -3.0),
        ] {
            let turn = DMat3::from_axis_angle(axis.normalize(), angle);
            let offset = DVec3::new(-20.0, 3.0, 100.0);
            let mut all = particles(places().iter().map(|p| turn * *p + offset).collect());
            superpose(&mut all, &GROUP, &reference).unwrap();
            for (i, expected) in places().into_iter().enumerate() {
                let found = all.positions.get(i);
                assert!(found.distance(expected) < 1e-9, "{axis} {angle}: {found} {expected}");
            }
            // Vectors and the cell turn with it, colours and sizes do not
            let back = turn.transpose();
            let AttributeData::F32(velocities) = &all.attributes[0].data else { panic!() };
            assert!(Vec3::from_slice(velocities).distance((back * DVec3::X).as_vec3()) < 1e-6);
            for other in [1, 3] {
                assert_eq!(all.attributes[other], particles(places()).attributes[other]);
            }
            let AttributeData::F64(forces) = &all.attributes[2].data else { panic!() };
            assert!(DVec3::from_slice(forces).distance(back * DVec3::Y * 2.0) < 1e-9);
            let cell = all.cell.unwrap();
            assert!(cell.vectors[2].distance(back * DVec3::Z) < 1e-9);
            assert!(cell.origin.distance(back * (DVec3::ONE - offset)) < 1e-9);
        }
    }

    #[test]
    fn no_other_rotation_is_nearer() {
        // With noise, and mirrored: the best rotation is not a mirror
        for mirror in [1.0, -1.0] {
            let noise = |i: usize| DVec3::new(0.3, -0.2, 0.1) * [1.0, -1.0, 0.5][i % 3];
            let moved = |(i, p): (usize, &DVec3)| DVec3::new(-p.y, mirror * p.x, p.z) + noise(i);
            let mut all = particles(places().iter().enumerate().map(moved).collect());
            let reference = GroupPlaces::of(&particles(places()), &GROUP);
            superpose(&mut all, &GROUP, &reference).unwrap();
            let found: Vec<DVec3> = GROUP.iter().map(|i| all.positions.get(*i as usize)).collect();
            let center = found.iter().sum::<DVec3>() / 5.0;
            let distance = |turn: DMat3| -> f64 {
                let pairs = found.iter().zip(&reference.places);
                pairs.map(|(a, b)| (turn * (*a - center) + center - *b).length_squared()).sum()
            };
            let best = distance(DMat3::IDENTITY);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, -0.8)] {
                for angle in [1e-3, -1e-3, 0.5, -0.5, 3.0] {
                    let other = distance(DMat3::from_axis_angle(axis, angle));
                    assert!(other > best, "{mirror} {axis} {angle}: {other} {best}");
                }
            }
        }
    }

    #[test]
    fn particles_are_matched_by_id() {
        let ids = |numbers: Vec<i32>| Attribute {
            name: "id".to_owned(),
            components: 1,
            data: AttributeData::I32(numbers),
        };
        let mut first = particles(places());
        first.attributes.push(ids((0..11).collect()));
        let reference = GroupPlaces::of(&first, &GROUP);
        // The same particles in another order
        let turn = DMat3::from_rotation_z(1.0);
        let mut later = particles(places().iter().rev().map(|p| turn * *p).collect());
        later.attributes.push(ids((0..11).rev().collect()));
        let chosen: Vec<u32> = GROUP.iter().rev().map(|i| 10 - i).collect();
        superpose(&mut later, &chosen, &reference).unwrap();
        assert!(later.positions.get(10).distance(places()[0]) < 1e-9);
        // Others
        let error = superpose(&mut later, &[1, 2, 3, 4, 5], &reference).unwrap_err();
        assert!(error.to_string().contains("other particles than in the first frame"), "{error}");
        let error = superpose(&mut later, &[1, 2, 3, 4], &reference).unwrap_err();
        assert!(error.to_string().contains("takes 4 particles here, but 5 in"), "{error}");
    }

    #[test]
    fn few_particles_and_lines_are_errors() {
        let fails = |places: &[DVec3]| {
            let chosen: Vec<u32> = (0..).take(places.len()).collect();
            let mut all = particles(places.to_vec());
            let reference = GroupPlaces::of(&all, &chosen);
            superpose(&mut all, &chosen, &reference).unwrap_err().to_string()
        };
        assert!(fails(&[DVec3::X, DVec3::Y]).contains("takes 2 particles with finite"));
        assert!(fails(&[DVec3::X, DVec3::Y, DVec3::NAN]).contains("takes 2 particles with finite"));
        let line: Vec<DVec3> = (0..9).map(|i| DVec3::new(1.0, 2.0, 3.0) * f64::from(i)).collect();
        assert!(fails(&line).contains("on a line"));
        assert!(fails(&[DVec3::X; 4]).contains("on a line"));
    }
}
