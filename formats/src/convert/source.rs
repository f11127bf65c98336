//! Sources of the particles of a frame: they provide ranges of particles, in any order and as often as
//! needed, so that a frame need not fit into memory.

use glam::DVec3;

use crate::{FrameError, ScalarType};

/// Particles of one frame, by their index in the source. Many threads read ranges at once.
pub trait ParticleSource: Sync {
    /// Particles.
    fn count(&self) -> u64;

    /// What else there is of each particle, in the order of [`Self::read_values`].
    fn attributes(&self) -> &[SourceAttribute];

    /// The radius of all particles, scene units, if the source has one. Radii of their own are an
    /// attribute.
    fn common_radius(&self) -> Option<f32> {
        None
    }

    /// Simulation time, if known.
    fn time(&self) -> Option<f64> {
        None
    }

    /// Step number of the simulation, if known.
    fn step(&self) -> Option<i64> {
        None
    }

    /// World positions of the particles from index `first` on, which need not be finite. The same ones each
    /// time, as precise as the source has them.
    ///
    /// # Errors
    /// If there are no such particles, or what should be there is damaged.
    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError>;

    /// The values of attribute number `attribute` of the particles from index `first` on: all components of
    /// one particle, then of the next, little-endian.
    ///
    /// # Errors
    /// As [`Self::read_positions`]; also if `to` does not hold whole particles.
    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError>;

    /// Checks that everything that was read was there, before the result is published.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if a mapped file changed meanwhile.
    fn check(&self) -> Result<(), FrameError> {
        Ok(())
    }
}

/// Numbers that a source has for each particle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceAttribute {
    /// Name, as in the file.
    pub name: String,
    /// Numbers a particle, at least 1.
    pub components: usize,
    /// Their type.
    pub scalar: ScalarType,
}

impl SourceAttribute {
    /// Bytes of the values of one particle.
    pub fn width(&self) -> usize {
        self.components * self.scalar.size()
    }
}
