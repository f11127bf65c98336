//! Finds the clumps of a flow that move fast and as a whole while the shutter is open.

use std::ops::Range;

use glam::Vec3;

use crate::field::FieldParticles;
use spherule_tree::order::index_u32;

/// Particles within this distance are linked, in supports of the kernel; neighbours in water are 0.5 apart. With the
/// default threshold, the surfaces of two particles merge up to 0.95, but motion blur hides such thin bridges. With 1, most
/// torn tongues of water were linked to the body.
const LINK: f32 = 0.75;

/// Larger clumps are not looked for: they are waves and sheets, whose parts move in different ways.
const MAX_PARTICLES: usize = 4096;

/// Particles that move by less from one slice of the exposure to the next leave no visible gap there, in radii.
const LEAST_STEP: f32 = 0.25;

/// Greatest difference between the motion of a particle and that of its clump, in parts of the latter.
const MAX_SPREAD: f32 = 0.5;

/// Particles in the middle of the exposure.
#[derive(Debug, Clone, Copy)]
pub struct ExposedParticles<'a> {
    /// Their centres, scene units.
    pub centers: &'a [Vec3],
    /// By how far each of them moves from the opening of the shutter to its closing, scene units.
    pub displacements: &'a [Vec3],
    /// Their radius, scene units.
    pub radius: f32,
    /// Radius of the kernel, scene units.
    pub support: f32,
    /// Number of slices of the exposure in which everything else stands still.
    pub slices: u32,
}

/// Clumps of particles that move fast, each as a whole.
#[derive(Debug, Default)]
pub struct FastClumps {
    /// Indices of their particles, one clump after the other.
    pub(super) particles: Vec<u32>,
    pub(super) clumps: Vec<FastClump>,
}

/// A clump.
#[derive(Debug, PartialEq)]
pub(super) struct FastClump {
    /// Its particles in those of all clumps.
    pub(super) range: Range<usize>,
    /// By how far it moves from the opening of the shutter to its closing.
    pub(super) motion: Vec3,
}

/// State of a particle in the search for connected components.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Label {
    Unvisited,
    /// In a clump, or in the component that is being searched.
    Clump,
    /// In the part of the surface that is drawn in slices.
    Rest,
}

impl FastClumps {
    /// The clumps among `particles`, in the order of their first particles.
    ///
    /// # Panics
    /// If there are fewer displacements than centres.
    #[must_use]
    pub fn of(particles: &ExposedParticles<'_>) -> Self {
        let least = LEAST_STEP * particles.radius * particles.slices.max(1) as f32;
        let is_fast = |motion: &Vec3| motion.length_squared() > least * least;
        let motions = &particles.displacements[..particles.centers.len()];
        let mut found = Self::default();
        if !motions.iter().any(is_fast) {
            return found;
        }
        // A clump with a slow particle is none
        let label = |motion| if is_fast(motion) { Label::Unvisited } else { Label::Rest };
        let mut labels: Vec<Label> = motions.iter().map(label).collect();
        let field = FieldParticles::sorted(particles.centers, LINK * particles.support, true);
        for first in 0..labels.len() {
            if labels[first] == Label::Unvisited {
                let (members, is_whole) = connected(&field, particles.centers, first, &mut labels);
                found.add(&members, is_whole, motions, &mut labels);
            }
        }
        found
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.clumps.is_empty()
    }

    /// Indices of the particles of all clumps in ascending order.
    #[must_use]
    pub fn sorted_particles(&self) -> Vec<u32> {
        let mut sorted = self.particles.clone();
        sorted.sort_unstable();
        sorted
    }

    /// Adds the clump of `members` if it `is_whole` and they move alike, and leaves it to the rest otherwise.
    fn add(&mut self, members: &[u32], is_whole: bool, motions: &[Vec3], labels: &mut [Label]) {
        let motion_of = |member: &u32| motions[*member as usize];
        let motion = members.iter().map(motion_of).sum::<Vec3>() / members.len() as f32;
        let spread = MAX_SPREAD * motion.length();
        if is_whole && members.iter().all(|member| motion_of(member).distance(motion) <= spread) {
            let start = self.particles.len();
            self.particles.extend_from_slice(members);
            self.clumps.push(FastClump { range: start..self.particles.len(), motion });
        } else {
            members.iter().for_each(|member| labels[*member as usize] = Label::Rest);
        }
    }
}

/// The particles that are connected with the `first` one, and whether these are a whole clump: not too many, and none of
/// the rest among them. Stops where that is known.
fn connected(
    field: &FieldParticles,
    centers: &[Vec3],
    first: usize,
    labels: &mut [Label],
) -> (Vec<u32>, bool) {
    let mut members = vec![index_u32(first)];
    labels[first] = Label::Clump;
    let (mut next, mut is_whole) = (0, true);
    while is_whole && next < members.len() {
        field.each_offset(centers[members[next] as usize], |other, _| {
            match labels[other as usize] {
                Label::Unvisited => {
                    labels[other as usize] = Label::Clump;
                    members.push(other);
                }
                Label::Clump => {}
                Label::Rest => is_whole = false,
            }
        });
        is_whole &= members.len() <= MAX_PARTICLES;
        next += 1;
    }
    (members, is_whole)
}
