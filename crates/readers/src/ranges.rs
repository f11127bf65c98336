//! Particles that a reader decodes range by range.

use std::fmt;

use glam::DVec3;

use spherule_frame::{Labels, ParseError, ScalarType, SimulationCell};

/// Name, components and scalar type of an attribute.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RangeAttribute {
    /// The name in the file.
    pub name: String,
    /// Numbers per particle.
    pub components: usize,
    /// The type of its numbers.
    pub scalar: ScalarType,
}

/// The particles of one time step, by index. Many threads read ranges at the same time, in any order.
pub trait ParticleRanges: Send + Sync + fmt::Debug {
    /// Number of particles.
    fn count(&self) -> u64;

    /// The attributes, in the order of [`Self::read_values`].
    fn attributes(&self) -> Vec<RangeAttribute>;

    /// Simulation time, if the file has it.
    fn time(&self) -> Option<f64>;

    /// Step number, if the file has it.
    fn step(&self) -> Option<i64>;

    /// The simulation cell, if the file has it.
    fn cell(&self) -> Option<SimulationCell>;

    /// What the user should know, such as columns that only some parts have.
    fn notes(&self) -> &[String];

    /// Names of parts and of other values.
    fn labels(&self) -> &Labels;

    /// Bytes of the positions of one particle in the precision of the file.
    fn position_len(&self) -> u64;

    /// Reads the positions of the particles from index `first` on, which exist.
    ///
    /// # Errors
    /// [`ParseError`] for damaged data.
    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), ParseError>;

    /// Reads the values of attribute number `attribute` of the particles from index `first` on, which exist,
    /// little-endian. `to` holds whole particles.
    ///
    /// # Errors
    /// As [`Self::read_positions`].
    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), ParseError>;
}
