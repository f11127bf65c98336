//! A generated block of water with waves: particles as in a simulation, in any number.

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::places;
use crate::FrameError;
use crate::ScalarType;
use crate::convert::{ParticleSource, SourceAttribute};
use crate::generate::{splitmix64, unit};

/// A block of particles on a slightly perturbed grid, about 4 : 2 : 1, under a wavy surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockSettings {
    /// Number of particles.
    pub count: u64,
    /// Seed of the perturbation.
    pub seed: u64,
    /// Radius, half the spacing of the grid, scene units. Without a radius, the block is about 1 unit high.
    pub radius: Option<f32>,
    /// Whether particles have a velocity.
    pub has_velocity: bool,
}

/// Particles of [`BlockSettings`]: slabs along x, columns along y in each slab, and particles from bottom to
/// top in each column.
#[derive(Debug)]
pub struct BlockSource {
    settings: BlockSettings,
    spacing: f64,
    /// Columns of a slab.
    columns: u64,
    /// First particle of each slab, and its height in particles.
    slabs: Vec<Slab>,
    attributes: Vec<SourceAttribute>,
}

#[derive(Debug, Clone, Copy)]
struct Slab {
    first: u64,
    height: u64,
}

/// Largest distance of particles from their grid positions along an axis, in grid spacings.
const DISORDER: f32 = 0.2;

impl BlockSource {
    /// The block of `settings`.
    pub fn new(settings: BlockSettings) -> Self {
        // Height of a block of 4 : 2 : 1, in grid spacings.
        let high = (settings.count as f64 / 8.0).cbrt();
        let spacing = match settings.radius {
            Some(radius) => 2.0 * f64::from(radius),
            None if settings.count > 0 => 1.0 / high,
            None => 1.0,
        };
        // Find the size of the block
        let columns = whole(2.0 * high);
        // Lay out slabs under the wave until all particles have a place
        let mut slabs = Vec::new();
        let mut first = 0;
        while first < settings.count {
            let along = slabs.len() as f64 / high / 4.0;
            let wave = 0.1 * (2.0 * TAU * along).sin() + 0.04 * (7.0 * TAU * along + 1.0).sin();
            let height = whole(high * (1.0 + wave));
            slabs.push(Slab { first, height });
            first += columns * height;
        }
        let velocity =
            SourceAttribute { name: "velocity".to_owned(), components: 3, scalar: ScalarType::F32 };
        Self {
            settings,
            spacing,
            columns,
            slabs,
            attributes: settings.has_velocity.then_some(velocity).into_iter().collect(),
        }
    }

    /// Radius of the particles.
    #[expect(clippy::cast_possible_truncation, reason = "radii are f32")]
    pub fn radius(&self) -> f32 {
        (0.5 * self.spacing) as f32
    }

    /// Calls `see` with `len` particles from index `first`.
    fn for_each(&self, first: u64, len: usize, mut see: impl FnMut(Vec3)) {
        let mut number = self.slabs.partition_point(|slab| slab.first <= first);
        let mut place = first;
        let end = first + len as u64;
        while place < end {
            let slab = self.slabs[number - 1];
            let after = slab.first + self.columns * slab.height;
            let (mut y, mut z) =
                ((place - slab.first) / slab.height, (place - slab.first) % slab.height);
            while place < end.min(after) {
                see(self.position([number as u64 - 1, y, z], place));
                place += 1;
                z += 1;
                if z == slab.height {
                    (y, z) = (y + 1, 0);
                }
            }
            number += 1;
        }
    }

    #[inline]
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 along an axis")]
    fn position(&self, cell: [u64; 3], place: u64) -> Vec3 {
        let noise = [1, 2, 3].map(|k| {
            let number = place.wrapping_mul(3).wrapping_add(k);
            2.0 * unit(splitmix64(self.settings.seed, number)) - 1.0
        });
        let grid = DVec3::from_array(cell.map(|c| c as f64 + 0.5));
        let noise = (DISORDER * Vec3::from_array(noise)).as_dvec3();
        ((grid + noise) * self.spacing).as_vec3()
    }

    /// The velocity of a wave along x, of about one block height per unit of time.
    fn velocity(&self, position: Vec3) -> Vec3 {
        let high = self.spacing * (self.settings.count as f64 / 8.0).cbrt();
        let place = position.as_dvec3() / high.max(f64::MIN_POSITIVE);
        let (sine, cosine) = (TAU * place.x / 2.0).sin_cos();
        let depth = place.z;
        (DVec3::new(cosine * depth, 0.1 * sine, sine * depth) * high).as_vec3()
    }
}

/// The nearest whole number, at least 1.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cast saturates")]
fn whole(value: f64) -> u64 {
    (value.round() as u64).max(1)
}

impl ParticleSource for BlockSource {
    fn count(&self) -> u64 {
        self.settings.count
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &self.attributes
    }

    fn common_radius(&self) -> Option<f32> {
        Some(self.radius())
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        places(Path::new("block"), first, to.len(), self.count())?;
        let len = to.len();
        let mut to = to.iter_mut();
        self.for_each(first, len, |position| {
            if let Some(to) = to.next() {
                *to = position.as_dvec3();
            }
        });
        Ok(())
    }

    fn read_values(&self, _attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError> {
        let (values, _) = to.as_chunks_mut::<12>();
        places(Path::new("block"), first, values.len(), self.count())?;
        let len = values.len();
        let mut values = values.iter_mut();
        self.for_each(first, len, |position| {
            if let Some(to) = values.next() {
                let velocity = self.velocity(position).to_array();
                *to = bytemuck::cast(velocity.map(f32::to_le_bytes));
            }
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(source: &BlockSource) -> Vec<DVec3> {
        let mut all = vec![DVec3::ZERO; usize::try_from(source.count()).expect("few")];
        source.read_positions(0, &mut all).expect("made");
        all
    }

    #[test]
    fn runs_are_parts_of_the_whole() {
        for count in [1, 2, 7, 100, 5000] {
            let source = BlockSource::new(BlockSettings {
                count,
                seed: 3,
                radius: None,
                has_velocity: true,
            });
            let whole = all(&source);
            for first in [0, 1, count / 3, count - 1] {
                let len = usize::try_from((count - first).min(77)).expect("few");
                let mut run = vec![DVec3::ZERO; len];
                source.read_positions(first, &mut run).expect("made");
                let first_place = usize::try_from(first).expect("few");
                assert_eq!(run, whole[first_place..first_place + len]);
            }
            assert!(source.read_positions(count, &mut [DVec3::ZERO]).is_err());
        }
    }

    #[test]
    fn neighbours_are_about_two_radii_apart() {
        let source = BlockSource::new(BlockSettings {
            count: 2000,
            seed: 1,
            radius: Some(0.5),
            has_velocity: false,
        });
        let all = all(&source);
        let size = all.iter().copied().fold(DVec3::ZERO, DVec3::max);
        assert!((size / size.z - DVec3::new(4.0, 2.0, 1.0)).abs().max_element() < 1.0);
        for (i, p) in all.iter().enumerate() {
            let near = all[..i].iter().map(|q| q.distance(*p));
            assert!(near.fold(f64::INFINITY, f64::min) > 0.55);
        }
    }
}
