//! Candidates of drops: where they are around their particles, and their sizes.

use glam::Vec3;

use crate::spray::{point_in_ball, random};
use spherule_tree::math::functions::{exp, ln, pow};

/// Number of drops of a particle with the highest potential.
pub const MAX_DROPS_EACH: u32 = 160;

/// Dimension of the random number that decides whether a particle is nothing but spray.
pub(super) const ATOMIZED: u32 = 1 << 24;

/// First dimension of the candidates.
const FIRST: u32 = ATOMIZED + 1;

/// Random numbers of a candidate: its threshold, three for its place, and its size.
const DIMENSIONS: u32 = 5;

/// Greatest distance of a drop from its particle in radii of the particle: about the distance to the next particle, so
/// that no gaps are between the drops of neighbours.
const SPREAD: f32 = 2.2;

/// The same for particles that have become spray, most of whose drops are closer; tuned by eye.
const SPRAY_SPREAD: f32 = 4.5;

/// Least, mean and greatest radius of spray in radii of the particle; tuned by eye.
const SPRAY_RADII: [f32; 3] = [0.012, 0.04, 0.2];

/// Least and greatest radius of foam and bubbles in radii of the particle; tuned by eye.
const BUBBLE_RADII: [f32; 2] = [0.045, 0.25];

/// The number of bubbles of a radius in a breaking wave falls off with this power of it, above the scale at which
/// turbulence breaks them up (Deane and Stokes 2002, "Scale dependence of bubble creation mechanisms in breaking
/// waves", Nature 418). Smaller ones are invisible.
const BUBBLE_POWER: f32 = 10.0 / 3.0;

/// A drop before its class is known. Lengths are in radii of its particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    /// Its place relative to that of the particle.
    pub(super) offset: Vec3,
    /// A random number for its size.
    size: f32,
}

/// The potential above which candidate `number` of the particle `id` exists.
pub(super) fn threshold(id: u32, number: u32) -> f32 {
    random(id, FIRST.wrapping_add(DIMENSIONS.wrapping_mul(number)))
}

/// Candidate `number` of the particle `id`.
pub(super) fn candidate(id: u32, number: u32, is_atomized: bool) -> Candidate {
    let first = FIRST.wrapping_add(DIMENSIONS.wrapping_mul(number));
    let random = |dimension: u32| random(id, first.wrapping_add(dimension));
    let point = point_in_ball([1, 2, 3].map(random), 1.0);
    let offset = if is_atomized { SPRAY_SPREAD * point.length() * point } else { SPREAD * point };
    Candidate { offset, size: random(4) }
}

impl Candidate {
    /// Its radius as a drop of water: sizes are distributed exponentially (Marshall and Palmer 1948, "The distribution
    /// of raindrops with size"), between the least and the greatest.
    pub(super) fn spray_radius(&self) -> f32 {
        let [least, mean, greatest] = SPRAY_RADII;
        let scale = mean - least;
        let all = 1.0 - exp((least - greatest) / scale);
        least - scale * ln(1.0 - all * self.size)
    }

    /// Its radius as a bubble, alone or in foam.
    pub(super) fn bubble_radius(&self) -> f32 {
        let [least, greatest] = BUBBLE_RADII;
        let power = 1.0 - BUBBLE_POWER;
        let [low, high] = [least, greatest].map(|radius| pow(radius, power));
        pow(low + (high - low) * self.size, 1.0 / power)
    }
}
