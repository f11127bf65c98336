//! Whitewater: where a flow mixes with air, and the spray, foam and bubbles there.
//!
//! It follows Ihmsen, Akinci, Akinci and Teschner 2012, "Unified spray, foam and air bubbles for particle-based
//! fluids": potentials for trapped air and for wave crests, each times one for kinetic energy (`potential.rs`, section
//! 2 of the paper), and classes by the number of neighbours (section 3). The paper moves its diffuse particles from
//! step to step, and lets them fade by age. Here, each frame stands alone: whether a drop exists follows from the
//! potential of its particle and a hash of the particle's id, so that drops stay with their particles and do not
//! flicker, and vanish where the water calms down.
//!
//! Sizes have the spectra of measurements (`drops.rs`).

use glam::Vec3;
use rayon::prelude::*;
use spherule_tree::order::index_u32;

use super::field::bins::Bins;
use super::spray::random;

mod drops;
mod potential;
#[cfg(test)]
mod tests;

use drops::{Candidate, candidate};
use potential::{Motions, Neighbourhood};

pub use drops::MAX_DROPS_EACH;

/// Maximum number of drops of a frame. With more, a part of all drops is left out.
pub const MAX_DROPS: usize = 1 << 22;

/// Bytes of a particle while its drops are searched: its place in the bins, and its potential.
pub const PARTICLE_BYTES: u64 = 48;

/// Bytes of a drop.
pub const DROP_BYTES: u64 = size_of::<Drop>() as u64;

/// Drops with fewer particles around them are spray, with more than [`BUBBLE`] bubbles, and else foam (section 3 of the
/// paper). In water at rest, there are 33 particles within four radii, and 17 at its surface.
const SPRAY: u32 = 6;
/// See [`SPRAY`].
const BUBBLE: u32 = 20;

/// Acceleration by gravity in metres per square second, the units of most simulations of water.
const GRAVITY: f32 = 9.81;

/// Part of the speed of a fall over the whole height of a scene below which water is never fully white; tuned on a pool
/// that sloshes.
const LEAST_OF_FALL: f32 = 0.4;

/// Particles of a flow.
#[derive(Debug, Clone, Copy)]
pub struct Flow<'a> {
    /// Their centres.
    pub centers: &'a [Vec3],
    /// Their velocities, scene units per unit of time.
    pub velocities: &'a [Vec3],
    /// Their ids; None if these are their indices.
    pub ids: Option<&'a [u32]>,
    /// Their radius.
    pub radius: f32,
}

/// How much whitewater there is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhitewaterSettings {
    /// Speed of violent water, to which speeds are relative; scene units per unit of time.
    pub speed: f32,
    /// Factor on the number of drops.
    pub amount: f32,
    /// Factor on their radii.
    pub size: f32,
}

/// Where a drop is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DropClass {
    /// In the air.
    Spray,
    /// On the surface of the water.
    Foam {
        /// The direction away from the particles around it, unit vector.
        up: Vec3,
    },
    /// In the water.
    Bubble,
}

/// A drop of water in the air, or of air in the water.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drop {
    /// Index in the flow of the particle with which it moves.
    pub particle: u32,
    /// Its place relative to that of the particle.
    pub offset: Vec3,
    /// Its radius.
    pub radius: f32,
    /// Where it is.
    pub class: DropClass,
}

/// The whitewater of a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Whitewater {
    /// Indices of the particles that are no part of the body of water, because they are nothing but spray; ascending.
    pub atomized: Vec<u32>,
    /// The drops, in the order of their particles.
    pub drops: Vec<Drop>,
    /// Number of drops that are left out, because there are more than [`MAX_DROPS`].
    pub left_out: u64,
}

impl Whitewater {
    /// The whitewater of `flow`, which depends on nothing else.
    ///
    /// # Panics
    /// If the arrays of `flow` have different lengths.
    #[must_use]
    pub fn of(flow: Flow<'_>, settings: WhitewaterSettings) -> Self {
        Self::at_most(MAX_DROPS, flow, settings)
    }

    /// The same with about so many drops at most.
    fn at_most(most: usize, flow: Flow<'_>, settings: WhitewaterSettings) -> Self {
        // There is no whitewater if the speed is zero or NaN
        if !(settings.speed > 0.0 && settings.amount > 0.0) || flow.centers.is_empty() {
            return Self::default();
        }
        let motions = Motions::of(&flow);
        let (potential, atomized) = motions.potentials(&flow, settings.speed);
        // Leave out a part if there are too many
        let source =
            Source { flow, settings, potential: &potential, atomized: &atomized, part: 1.0 };
        let count = source.count();
        let part = if count > most as u64 { most as f32 / count as f32 } else { 1.0 };
        let drops = Source { part, ..source }.drops(motions.bins());
        let left_out = count - drops.len() as u64;
        let places = (0..).zip(&atomized).filter(|(_, is_atomized)| **is_atomized);
        Self { atomized: places.map(|(index, _)| index).collect(), drops, left_out }
    }
}

/// Number of drops of `flow` at each of several `speeds` of violent water, with a factor `amount`.
///
/// # Panics
/// If the arrays of `flow` have different lengths.
#[must_use]
pub fn drop_counts(flow: Flow<'_>, speeds: &[f32], amount: f32) -> Vec<u64> {
    let motions = Motions::of(&flow);
    let count = |speed: &f32| {
        let (potential, atomized) = motions.potentials(&flow, *speed);
        let settings = WhitewaterSettings { speed: *speed, amount, size: 1.0 };
        let source =
            Source { flow, settings, potential: &potential, atomized: &atomized, part: 1.0 };
        if *speed > 0.0 { source.count().min(MAX_DROPS as u64) } else { 0 }
    };
    speeds.iter().map(count).collect()
}

/// Speed of violent water in a job whose fastest particles have this `speed`, and whose scene has this `height`. If
/// all of the water is slow for water of this height, none of it is violent. The height is taken to be in metres, and
/// the speed in metres per second; in shorter units of length, only the speed counts.
#[must_use]
pub fn violent_speed(speed: f32, height: f32) -> f32 {
    speed.max(LEAST_OF_FALL * (2.0 * GRAVITY * height.max(0.0)).sqrt())
}

/// What drops are made from.
#[derive(Clone, Copy)]
struct Source<'a> {
    flow: Flow<'a>,
    settings: WhitewaterSettings,
    /// The potential of each particle, 0 to 1.
    potential: &'a [f32],
    /// Whether each particle is nothing but spray.
    atomized: &'a [bool],
    /// The part of the drops that is made.
    part: f32,
}

impl Source<'_> {
    /// Candidates of a particle that exist.
    fn candidates(&self, particle: usize) -> impl Iterator<Item = Candidate> {
        let id = self.flow.ids.map_or_else(|| index_u32(particle), |ids| ids[particle]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let most = (self.settings.amount * MAX_DROPS_EACH as f32).ceil() as u32;
        let limit = self.potential[particle] * self.part;
        let is_atomized = self.atomized[particle];
        let exists = move |number: &u32| drops::threshold(id, *number) < limit;
        let numbers = if limit > 0.0 { 0..most } else { 0..0 };
        numbers.filter(exists).map(move |number| candidate(id, number, is_atomized))
    }

    /// Number of drops.
    fn count(&self) -> u64 {
        let particles = (0..self.potential.len()).into_par_iter().with_min_len(1 << 10);
        particles.map(|particle| self.candidates(particle).count() as u64).sum()
    }

    /// The drops, with their classes by the particles in `bins` around them.
    fn drops(&self, bins: &Bins) -> Vec<Drop> {
        let (radius, factor) = (self.flow.radius, self.flow.radius * self.settings.size);
        let particles = (0..self.potential.len()).into_par_iter().with_min_len(1 << 8);
        particles
            .flat_map_iter(|particle| {
                let center = self.flow.centers[particle];
                self.candidates(particle).map(move |candidate| {
                    let offset = radius * candidate.offset;
                    let around = Neighbourhood::of(bins, center + offset);
                    let (class, size) = match around.count {
                        count if count < SPRAY => (DropClass::Spray, candidate.spray_radius()),
                        count if count > BUBBLE => (DropClass::Bubble, candidate.bubble_radius()),
                        _ => {
                            let up = around.outward.try_normalize().unwrap_or(Vec3::ZERO);
                            (DropClass::Foam { up }, candidate.bubble_radius())
                        }
                    };
                    let particle = index_u32(particle);
                    Drop { particle, offset, radius: factor * size, class }
                })
            })
            .collect()
    }
}

/// Whether the particle `id` with this potential of its energy, which has few neighbours, is nothing but spray.
fn is_atomized(id: u32, energy: f32) -> bool {
    random(id, drops::ATOMIZED) < energy
}
