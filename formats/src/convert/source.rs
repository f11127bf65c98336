//! Sources of the particles of a frame. A source provides ranges of particles, in any order and as often as
//! needed, so that a frame need not fit into memory.

use glam::DVec3;

use crate::{FrameError, Labels, ScalarType, SimulationCell};

/// The particles of one frame, by their index in the source. Many threads read ranges at the same time.
pub trait ParticleSource: Sync {
    /// Number of particles.
    fn count(&self) -> u64;

    /// The attributes of the particles, in the order of [`Self::read_values`].
    fn attributes(&self) -> &[SourceAttribute];

    /// The radius of all particles, scene units, if the source has one. Radii that differ are an attribute.
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

    /// The simulation cell, if known.
    fn cell(&self) -> Option<SimulationCell> {
        None
    }

    /// What the user should know, such as columns that only some parts have.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// Names of parts and of other values.
    fn labels(&self) -> Labels {
        Labels::new()
    }

    /// Bytes of the positions of one particle in the precision of the source, if that is known.
    fn position_len(&self) -> Option<u64> {
        None
    }

    /// Reads the world positions of the particles from index `first`, with the precision of the source. They
    /// need not be finite. Repeated calls give the same positions.
    ///
    /// # Errors
    /// If these particles do not exist, or their data is damaged.
    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError>;

    /// Reads the values of attribute number `attribute` of the particles from index `first`: all components of
    /// one particle, then those of the next, little-endian.
    ///
    /// # Errors
    /// As [`Self::read_positions`]; also if `to` does not hold whole particles.
    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError>;

    /// Checks that all data that was read was present, before the result is published.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if a mapped file changed since it was opened.
    fn check(&self) -> Result<(), FrameError> {
        Ok(())
    }
}

/// An attribute: numbers that a source has for each particle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceAttribute {
    /// The name, as in the file.
    pub name: String,
    /// Numbers per particle, at least 1.
    pub components: usize,
    /// The type of the numbers.
    pub scalar: ScalarType,
}

impl SourceAttribute {
    /// Bytes of the values of one particle.
    pub fn width(&self) -> usize {
        self.components * self.scalar.size()
    }
}
