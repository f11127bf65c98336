//! Frames moved so that a group of particles stays in place: in the middle of a periodic cell, or where it was.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use crate::{Molecules, Positions, RawParticles, SimulationCell};

/// Bytes for each particle that [`center_in_cell`] needs at most: sums and means of molecules.
pub const BYTES_EACH: u64 = (size_of::<Sum>() + size_of::<(DVec3, f64)>()) as u64;

/// The mean direction on a circle means something above this part of the radius.
const MIN_RESULTANT: f64 = 1e-9;

/// The mean of the positions of the `chosen` particles that are finite; none without one.
pub fn mean_position(positions: &Positions, chosen: &[u32]) -> Option<DVec3> {
    let mut sum = Sum::default();
    chosen.iter().for_each(|particle| sum.add(positions.get(*particle as usize)));
    sum.mean()
}

/// Moves all particles so that the mean position of the `chosen` ones is at `place`. Nothing moves without one of them.
pub fn move_mean_to(particles: &mut RawParticles, chosen: &[u32], place: DVec3) {
    if let Some(mean) = mean_position(&particles.positions, chosen) {
        particles.positions.each(|position| position + (place - mean));
    }
}

/// Moves all particles so that the centre of the `chosen` ones is in the middle of the `cell`, then each molecule to the
/// image whose centre is in the cell: particles one by one where nothing is known of molecules, and none if they are
/// unfolded. The cell stays where it is. `inverse`: [`SimulationCell::fractions`].
///
/// The centre of a group that the boundary cuts is the circular mean along each edge along which the cell repeats
/// (Bai and Breen, Journal of Graphics Tools 13, 2008), then the mean of the images that are nearest to it.
/// Nothing moves without a chosen particle with a finite position.
pub fn center_in_cell(
    particles: &mut RawParticles,
    (cell, inverse): (&SimulationCell, DMat3),
    molecules: &Molecules,
    chosen: &[u32],
) {
    let Some(center) = center_of(&particles.positions, (cell, inverse), molecules, chosen) else {
        return;
    };
    let [a, b, c] = cell.vectors;
    let offset = DMat3::from_cols(a, b, c) * (DVec3::splat(0.5) - center);
    particles.positions.each(|position| position + offset);
    if *molecules != Molecules::Unfolded {
        wrap(particles, (cell, inverse), molecules);
    }
}

/// The centre of the `chosen` particles, in fractions of the edges; none without one that is finite.
fn center_of(
    positions: &Positions,
    (cell, inverse): (&SimulationCell, DMat3),
    molecules: &Molecules,
    chosen: &[u32],
) -> Option<DVec3> {
    // Find the parts of the group in each molecule
    let mut sums = vec![Sum::default(); unit_count(molecules, positions.len())];
    for particle in chosen.iter().map(|particle| *particle as usize) {
        sums[unit_of(molecules, particle)].add(positions.get(particle));
    }
    let fractions = |part: &Sum| {
        let place = inverse * (part.mean()? - cell.origin);
        Some((place, f64::from(part.count)))
    };
    let parts: Vec<(DVec3, f64)> = sums.iter().filter_map(fractions).collect();
    if parts.is_empty() {
        return None;
    }
    // Take the mean along each edge
    let folds = *molecules != Molecules::Unfolded;
    Some(DVec3::from_array(std::array::from_fn(|edge| {
        let along = || parts.iter().map(|(place, weight)| (place[edge], *weight));
        if folds && cell.periodic[edge] { periodic_mean(along) } else { mean(along()) }
    })))
}

/// Moves each molecule by whole edges, so that its centre is in the cell.
fn wrap(
    particles: &mut RawParticles,
    (cell, inverse): (&SimulationCell, DMat3),
    molecules: &Molecules,
) {
    let count = particles.positions.len();
    let mut sums = vec![Sum::default(); unit_count(molecules, count)];
    for particle in 0..count {
        sums[unit_of(molecules, particle)].add(particles.positions.get(particle));
    }
    let mut all = 0..count;
    particles.positions.each(|position| {
        let unit = all.next().map_or(0, |particle| unit_of(molecules, particle));
        let Some(mean) = sums[unit].mean() else { return position };
        let cells = (inverse * (mean - cell.origin)).floor().to_array();
        let edges = cell.vectors.iter().zip(cells).zip(cell.periodic);
        edges.fold(position, |moved, ((edge, cells), is_periodic)| {
            if is_periodic && cells != 0.0 { moved - cells * *edge } else { moved }
        })
    });
}

/// Number of units that stay together, and move as a whole.
const fn unit_count(molecules: &Molecules, particles: usize) -> usize {
    match molecules {
        Molecules::Unknown => particles,
        Molecules::Whole { count, .. } => *count as usize,
        Molecules::Unfolded => 1,
    }
}

/// The unit of a particle.
fn unit_of(molecules: &Molecules, particle: usize) -> usize {
    match molecules {
        Molecules::Unknown => particle,
        Molecules::Whole { of, .. } => of[particle] as usize,
        Molecules::Unfolded => 0,
    }
}

/// The sum of finite positions.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    sum: DVec3,
    count: u32,
}

impl Sum {
    fn add(&mut self, position: DVec3) {
        if position.is_finite() {
            self.sum += position;
            self.count += 1;
        }
    }

    fn mean(&self) -> Option<DVec3> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }
}

/// The mean of numbers with weights.
fn mean(numbers: impl Iterator<Item = (f64, f64)>) -> f64 {
    let add = |(sum, total), (number, weight)| (sum + weight * number, total + weight);
    let (sum, total) = numbers.fold((0.0, 0.0), add);
    sum / total
}

/// The mean of numbers with weights, all of which stand for themselves plus any integer.
fn periodic_mean<I: Iterator<Item = (f64, f64)>>(numbers: impl Fn() -> I) -> f64 {
    let on_circle = |of: fn(f64) -> f64| {
        mean(numbers().map(|(number, weight)| (of(TAU * (number - number.floor())), weight)))
    };
    let (cosine, sine) = (on_circle(libm::cos), on_circle(libm::sin));
    if libm::hypot(cosine, sine) < MIN_RESULTANT {
        return mean(numbers());
    }
    let near = libm::atan2(sine, cosine) / TAU;
    mean(numbers().map(|(number, weight)| (number - (number - near).round(), weight)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tilted cell.
    fn cell(periodic: [bool; 3]) -> (SimulationCell, DMat3) {
        let edges = [DVec3::X * 10.0, DVec3::new(2.0, 10.0, 0.0), DVec3::new(1.0, -3.0, 8.0)];
        let cell = SimulationCell::new(DVec3::new(5.0, -1.0, 2.0), edges, periodic).unwrap();
        (cell, cell.fractions().unwrap())
    }

    /// Particles at these fractions of the edges.
    fn particles(cell: &SimulationCell, fractions: &[[f64; 3]]) -> RawParticles {
        let [a, b, c] = cell.vectors;
        let place = |at: &[f64; 3]| cell.origin + at[0] * a + at[1] * b + at[2] * c;
        RawParticles {
            positions: Positions::F64(fractions.iter().map(place).collect()),
            ..RawParticles::default()
        }
    }

    #[track_caller]
    fn is_at(found: &RawParticles, cell: &SimulationCell, fractions: &[[f64; 3]]) {
        let expected = particles(cell, fractions);
        for i in 0..fractions.len() {
            let (found, expected) = (found.positions.get(i), expected.positions.get(i));
            assert!(found.distance(expected) < 1e-9, "{i}: {found} {expected}");
        }
    }

    #[test]
    fn a_group_that_the_boundary_cuts_is_in_the_middle() {
        let (cell, inverse) = cell([true; 3]);
        // Two of the group on each side of a corner, unevenly; one of them some cells away, and one without a place
        let start = [[0.9, 0.95, 0.1], [1.1, 0.05, -0.1], [0.0, 3.0, 2.9], [0.2, 0.5, 0.5]];
        let mut all = particles(&cell, &start);
        if let Positions::F64(positions) = &mut all.positions {
            positions.push(DVec3::NAN);
        }
        center_in_cell(&mut all, (&cell, inverse), &Molecules::Unknown, &[0, 1, 2, 4]);
        // The mean is 0.0, 0.0, -1/30
        let z = 1.0 / 30.0;
        let expected =
            [[0.4, 0.45, 0.6 + z], [0.6, 0.55, 0.4 + z], [0.5, 0.5, 0.4 + z], [0.7, 0.0, 0.0 + z]];
        is_at(&all, &cell, &expected[..3]);
        let far = inverse * (all.positions.get(3) - cell.origin);
        assert!((far.x - 0.7).abs() < 1e-9 && (far.z - z).abs() < 1e-9, "{far}");
        // On the boundary, rounding decides
        assert!(far.y.abs() < 1e-9 || (far.y - 1.0).abs() < 1e-9, "{far}");
        assert!(all.positions.get(4).is_nan());
        // Nothing to follow
        let before = all.positions.get(0);
        center_in_cell(&mut all, (&cell, inverse), &Molecules::Unknown, &[4]);
        assert_eq!(all.positions.get(0), before);
    }

    #[test]
    fn molecules_stay_whole_around_it() {
        let (cell, inverse) = cell([true, true, false]);
        // The group, another molecule that reaches out of the cell afterwards, and one that follows it
        let start = [[0.95, 0.5, 0.5], [1.05, 0.5, 0.5], [0.35, 0.2, 2.0], [0.5, 0.2, 2.0]];
        let molecules = Molecules::Whole { of: vec![0, 0, 1, 1], count: 2 };
        let mut all = particles(&cell, &start);
        center_in_cell(&mut all, (&cell, inverse), &molecules, &[0, 1]);
        // Moved by half an edge, and the second one back by a whole one if its centre is beyond
        let expected = [[0.45, 0.5, 0.5], [0.55, 0.5, 0.5], [0.85, 0.2, 2.0], [1.0, 0.2, 2.0]];
        is_at(&all, &cell, &expected);
        let mut all = particles(&cell, &start);
        center_in_cell(&mut all, (&cell, inverse), &molecules, &[2]);
        // The part in the group counts, not the whole molecule; along c nothing repeats
        let expected = [[0.1, 0.8, -1.0], [0.2, 0.8, -1.0], [0.5, 0.5, 0.5], [0.65, 0.5, 0.5]];
        is_at(&all, &cell, &expected);
        // Unfolded particles are all shifted alike
        let mut all = particles(&cell, &[[0.0; 3], [7.5, -3.0, 0.0]]);
        center_in_cell(&mut all, (&cell, inverse), &Molecules::Unfolded, &[0, 1]);
        is_at(&all, &cell, &[[-3.25, 2.0, 0.5], [4.25, -1.0, 0.5]]);
    }

    #[test]
    fn two_molecules_of_a_group_come_together() {
        let (cell, inverse) = cell([true; 3]);
        let molecules = Molecules::Whole { of: vec![0, 0, 1, 1], count: 2 };
        let start = [[0.90, 0.5, 0.5], [0.94, 0.5, 0.5], [0.02, 0.5, 0.5], [0.06, 0.5, 0.5]];
        let mut all = particles(&cell, &start);
        center_in_cell(&mut all, (&cell, inverse), &molecules, &[0, 1, 2, 3]);
        let expected = [[0.42, 0.5, 0.5], [0.46, 0.5, 0.5], [0.54, 0.5, 0.5], [0.58, 0.5, 0.5]];
        is_at(&all, &cell, &expected);
        // A group all over the cell has no direction; its plain mean is used
        let start = [[0.125, 0.0, 0.0], [0.375, 0.0, 0.0], [0.625, 0.0, 0.0], [0.875, 0.0, 0.0]];
        let mut all = particles(&cell, &start);
        center_in_cell(&mut all, (&cell, inverse), &Molecules::Unknown, &[0, 1, 2, 3]);
        is_at(&all, &cell, &start.map(|[a, _, _]| [a, 0.5, 0.5]));
    }

    #[test]
    fn without_a_cell_the_mean_moves_to_a_place() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::NAN, DVec3::splat(7.0)];
        let mut all =
            RawParticles { positions: Positions::F64(positions), ..RawParticles::default() };
        move_mean_to(&mut all, &[0, 1, 2], DVec3::Y);
        assert_eq!(all.positions.get(1), DVec3::new(0.5, 1.0, 0.0));
        assert_eq!(all.positions.get(3), DVec3::new(6.5, 8.0, 7.0));
        move_mean_to(&mut all, &[2], DVec3::ZERO);
        assert_eq!(all.positions.get(3), DVec3::new(6.5, 8.0, 7.0));
        assert_eq!(mean_position(&all.positions, &[]), None);
    }
}
