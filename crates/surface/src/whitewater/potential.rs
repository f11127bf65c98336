//! How much air a flow mixes in at each of its particles: section 2 of Ihmsen et al. 2012, without units. Speeds are
//! relative to that of violent water, and sums over neighbours to those in water at rest.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::{Flow, is_atomized};
use crate::field::bins::Bins;

/// Support of the kernel in particle radii. Particles at rest are two radii apart.
pub(super) const REACH: f32 = 4.0;

/// Sum of the kernel `1 - distance / support` over the neighbours of a particle in water at rest: its integral, `PI /
/// 3` times the third power of the support, divided by the volume of a particle, 8.
pub(super) const SUM_AT_REST: f32 = PI / 3.0 * REACH * REACH * REACH / 8.0;

/// Thresholds between which a potential rises from 0 to 1; of trapped air, crests and energy. Tuned on dam breaks of
/// 10 000 and of 200 000 particles.
const TRAPPED_AIR: [f32; 2] = [0.06, 0.3];
/// See [`TRAPPED_AIR`].
const CREST: [f32; 2] = [0.06, 0.25];
/// See [`TRAPPED_AIR`]. The energy is the square of the speed.
const ENERGY: [f32; 2] = [0.04, 0.5];

/// The same for particles that are nothing but spray: drops that leave the water break up at once, unless they are
/// slow.
const ATOMIZING: [f32; 2] = [0.01, 0.1];

/// Particles with at most this many within the support, themselves included, may be nothing but spray: the corner of a
/// block has 8. Alone they would be balls of glass.
const MAX_ALONE: u32 = 7;

/// The least mean direction away from neighbours of a particle at the surface; it is 1/2 at a plane.
const AT_SURFACE: f32 = 0.25;

/// The least cosine between velocity and normal at a crest (section 2.2 of the paper).
const FORWARD: f32 = 0.6;

/// Maximum number of particles that are looked at for one: water at rest has 216 in the bins around it. It bounds the
/// work if many particles are in one place.
const MAX_VISITS: usize = 4096;

/// Speeds from here on are not those of water, and count as zero, so that no square is infinite; scene units per unit
/// of time.
const MAX_SPEED: f32 = 1e15;

/// Calls `each` with the place in `bins`, the offset to `point` and the distance of particles within the size of the
/// bins.
pub(super) fn each_neighbour(bins: &Bins, point: Vec3, mut each: impl FnMut(usize, Vec3, f32)) {
    let [x, y, z] = bins.cell_of(point);
    let limit = bins.size() * bins.size();
    let mut visits = 0;
    for z in z.saturating_sub(1)..=z.saturating_add(1) {
        for y in y.saturating_sub(1)..=y.saturating_add(1) {
            let run = bins.run(z, y, x.saturating_sub(1)..x.saturating_add(2));
            for place in bins.particles_in(run) {
                let offset = point - bins.points()[place];
                let squared = offset.length_squared();
                if squared < limit {
                    each(place, offset, squared.sqrt());
                }
                visits += 1;
                if visits == MAX_VISITS {
                    return;
                }
            }
        }
    }
}

/// What is around a point.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Neighbourhood {
    /// Number of particles within the support.
    pub(super) count: u32,
    /// The mean direction away from them, weighted by the kernel.
    pub(super) outward: Vec3,
}

impl Neighbourhood {
    /// The particles in `bins` around `point`.
    pub(super) fn of(bins: &Bins, point: Vec3) -> Self {
        let (mut found, mut sum) = (Self::default(), 0.0);
        each_neighbour(bins, point, |_, offset, distance| {
            let weight = 1.0 - distance / bins.size();
            found.count += 1;
            found.outward += weight * offset.normalize_or_zero();
            sum += weight;
        });
        Self { outward: if sum > 0.0 { found.outward / sum } else { Vec3::ZERO }, ..found }
    }
}

/// The motion at a particle.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    around: Neighbourhood,
    /// Mean speed at which neighbours come nearer, scene units per unit of time.
    trapped_air: f32,
}

/// The motion at all particles, in the order of their bins.
pub(super) struct Motions {
    bins: Bins,
    motions: Vec<Motion>,
}

/// `value` between `least`, which becomes 0, and `greatest`, which becomes 1 (equation 1 of the paper).
fn clamped(value: f32, [least, greatest]: [f32; 2]) -> f32 {
    // NaN is neither
    ((value - least) / (greatest - least)).clamp(0.0, 1.0).max(0.0)
}

/// `velocity`, or zero if it is none.
fn finite(velocity: Vec3) -> Vec3 {
    if velocity.is_finite() && velocity.abs().max_element() < MAX_SPEED {
        velocity
    } else {
        Vec3::ZERO
    }
}

impl Motions {
    /// The motion at the particles of `flow`.
    pub(super) fn of(flow: &Flow<'_>) -> Self {
        // Sums must not depend on the order in the file
        let mut bins = Bins::sort(flow.centers, REACH * flow.radius, true);
        bins.order_by_position();
        let places = (0..bins.points().len()).into_par_iter().with_min_len(1 << 8);
        let motions = places.map(|place| motion_at(&bins, flow, place)).collect();
        Self { bins, motions }
    }

    /// The particles, sorted into bins of the size of the support.
    pub(super) fn bins(&self) -> &Bins {
        &self.bins
    }

    /// The largest mean speed at which the neighbours of a particle come nearer.
    #[cfg(test)]
    pub(super) fn largest_trapped_air(&self) -> f32 {
        self.motions.iter().map(|motion| motion.trapped_air).fold(0.0, f32::max)
    }

    /// The potential of each particle of `flow`, in its order, and whether it is nothing but spray; `speed` is that of
    /// violent water.
    pub(super) fn potentials(&self, flow: &Flow<'_>, speed: f32) -> (Vec<f32>, Vec<bool>) {
        let places = (0..self.motions.len()).into_par_iter().with_min_len(1 << 8);
        let found: Vec<(f32, bool)> =
            places.map(|place| self.potential_at(flow, speed, place)).collect();
        let mut potentials = vec![0.0; flow.centers.len()];
        let mut atomized = vec![false; flow.centers.len()];
        for ((potential, is_atomized), index) in found.into_iter().zip(self.bins.indices()) {
            potentials[*index as usize] = potential;
            atomized[*index as usize] = is_atomized;
        }
        (potentials, atomized)
    }

    /// The potential of the particle at `place`, and whether it is nothing but spray.
    fn potential_at(&self, flow: &Flow<'_>, speed: f32, place: usize) -> (f32, bool) {
        let index = self.bins.indices()[place];
        let velocity = finite(flow.velocities[index as usize]) / speed;
        let energy = clamped(velocity.length_squared(), ENERGY);
        let motion = &self.motions[place];
        if motion.around.count <= MAX_ALONE {
            let id = flow.ids.map_or(index, |ids| ids[index as usize]);
            let energy = clamped(velocity.length_squared(), ATOMIZING);
            let is_spray = is_atomized(id, energy);
            return (if is_spray { 1.0 } else { 0.0 }, is_spray);
        }
        if energy == 0.0 {
            return (0.0, false);
        }
        let air = clamped(motion.trapped_air / speed, TRAPPED_AIR);
        let crest = clamped(self.crest_at(place, velocity), CREST);
        (energy * (air + crest).min(1.0), false)
    }

    /// The curvature of the surface at `place` if it is convex and moves forward, relative to the sum at rest
    /// (equations 3 to 6 of the paper); 0 elsewhere.
    fn crest_at(&self, place: usize, velocity: Vec3) -> f32 {
        let outward = self.motions[place].around.outward;
        let normal = outward.normalize_or_zero();
        if outward.length() < AT_SURFACE || velocity.normalize_or_zero().dot(normal) < FORWARD {
            return 0.0;
        }
        let mut sum = 0.0;
        each_neighbour(&self.bins, self.bins.points()[place], |other, offset, distance| {
            let theirs = self.motions[other].around.outward;
            // Neighbours in the water have no normal, and those in front of the crest make it concave
            if theirs.length() >= AT_SURFACE && offset.dot(normal) > 0.0 {
                let weight = 1.0 - distance / self.bins.size();
                sum += (1.0 - normal.dot(theirs.normalize_or_zero())) * weight;
            }
        });
        sum / SUM_AT_REST
    }
}

/// The motion of `flow` at `place` in `bins`: equation 2 of the paper, in units of the sum at rest.
fn motion_at(bins: &Bins, flow: &Flow<'_>, place: usize) -> Motion {
    let velocity_of = |place: usize| finite(flow.velocities[bins.indices()[place] as usize]);
    let (point, velocity) = (bins.points()[place], velocity_of(place));
    let mut air = 0.0;
    each_neighbour(bins, point, |other, offset, distance| {
        let relative = velocity - velocity_of(other);
        let closing = relative.normalize_or_zero().dot(offset.normalize_or_zero());
        air += relative.length() * (1.0 - closing) * (1.0 - distance / bins.size());
    });
    Motion { around: Neighbourhood::of(bins, point), trapped_air: air / SUM_AT_REST }
}
