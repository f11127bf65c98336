//! Particles in a plane or on a surface, such as points of a scan, and the radius with which their spheres cover it.

use glam::DVec3;
use rayon::prelude::*;
use spherule_formats::sample_indices;

use super::shape::Axes;

/// Number of particles whose surroundings are examined.
const QUERIES: usize = 256;

/// Radius of the surroundings in distances of nearest neighbours: 50 particles of a square lattice, a dozen at random.
const REACH: f64 = 4.0;

/// Fewest particles of surroundings that say something.
const FEW: usize = 5;

/// Greatest standard deviation along the normal, relative to those along the surface: 0.55 at the face of a body.
const THIN: f64 = 0.25;

/// Radius relative to the edge of the square that each particle of a lattice has: a little more than half its diagonal.
const COVERING: f64 = 0.75;

/// The same for particles at random, which cover 98 % of the surface.
const COVERING_AT_RANDOM: f64 = 1.1;

/// The distance of nearest neighbours relative to that edge, for particles at random.
const RANDOM: f64 = 0.5;

/// The quantile of the densities that is used: those near an edge are too low.
const BULK: f64 = 0.75;

/// The radius with which spheres around `count` particles cover the surface that they are on, if most lie on one.
/// `sample`: some of them; `touching`: half the median distance of neighbours among all.
pub(super) fn covering_radius(sample: &[DVec3], count: usize, touching: f64) -> Option<f64> {
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let part = sample.len() as f64 / count.max(1) as f64;
    // In a sample, neighbours are farther apart
    let reach = REACH * 2.0 * touching / part.sqrt();
    let queries: Vec<DVec3> = sample_indices(sample.len(), QUERIES).map(|i| sample[i]).collect();
    // Find out whether the surroundings of particles are thin
    let surroundings = queries.par_iter().map(|query| {
        let found = sample.iter().filter(|p| p.distance_squared(*query) <= reach * reach);
        let near: Vec<DVec3> = found.copied().collect();
        let axes = Axes::of(&near).filter(|_| near.len() >= FEW)?;
        let [_, across, normal] = axes.deviations;
        Some((near.len(), normal <= THIN * across))
    });
    let surroundings: Vec<(usize, bool)> = surroundings.flatten().collect();
    // Most of them have to be, for the rest to mean anything
    let thin = surroundings.iter().filter(|(_, is_thin)| *is_thin).count();
    if surroundings.len() * 2 < queries.len() || thin * 10 < surroundings.len() * 9 {
        return None;
    }
    // Find the mean distance on the surface from the number of neighbours
    let mut counts: Vec<usize> = surroundings.into_iter().map(|(count, _)| count).collect();
    counts.sort_unstable();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "hundreds of counts"
    )]
    let typical = *counts.get((BULK * counts.len() as f64) as usize)? as f64;
    let edge = (std::f64::consts::PI * reach * reach * part / typical).sqrt();
    // The less even the distances are, the larger are the holes
    let order = ((2.0 * touching / edge - RANDOM) / (1.0 - RANDOM)).clamp(0.0, 1.0);
    Some(edge * (COVERING_AT_RANDOM + order * (COVERING - COVERING_AT_RANDOM)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` points with the coordinates that `place` makes of two random numbers.
    fn points(count: usize, place: impl Fn(f64, f64) -> DVec3) -> Vec<DVec3> {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        (0..count).map(|_| (uniform(), uniform())).map(|(u, v)| place(u, v)).collect()
    }

    #[test]
    fn planes_and_surfaces_are_covered_and_bodies_have_none() {
        let lattice: Vec<DVec3> =
            (0..2500).map(|i| DVec3::new(f64::from(i % 50), f64::from(i / 50), 0.0)).collect();
        let radius = covering_radius(&lattice, 2500, 0.5).expect("a plane");
        assert!((0.7..0.8).contains(&radius), "{radius}");
        // A quarter of the particles
        let part: Vec<DVec3> =
            lattice.iter().filter(|p| p.x % 2.0 + p.y % 2.0 == 0.0).copied().collect();
        let radius = covering_radius(&part, 2500, 0.5).expect("a plane");
        assert!((0.7..0.8).contains(&radius), "{radius}");
        // Random points on a ball, whose neighbours are at half the distance of those of a lattice
        let ball = points(10_000, |u, v| {
            let (z, angle) = (2.0 * u - 1.0, std::f64::consts::TAU * v);
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * libm::cos(angle), r * libm::sin(angle), z)
        });
        let edge = (4.0 * std::f64::consts::PI / 1e4).sqrt();
        let radius = covering_radius(&ball, 10_000, 0.235 * edge).expect("a surface");
        assert!((0.9..1.3).contains(&(radius / edge)), "{}", radius / edge);
        let body: Vec<DVec3> = (0..4096)
            .map(|i| [i % 16, i / 16 % 16, i / 256].map(f64::from))
            .map(DVec3::from_array)
            .collect();
        assert_eq!(covering_radius(&body, 4096, 0.5), None);
        assert_eq!(covering_radius(&[], 0, 0.5), None);
    }
}
