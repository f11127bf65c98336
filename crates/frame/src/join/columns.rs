//! The columns of parts, without their numbers.

use crate::ScalarType;

/// A column of a part without its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnShape<'a> {
    /// The name.
    pub name: &'a str,
    /// Numbers per particle.
    pub components: usize,
    /// Type of the numbers.
    pub scalar: ScalarType,
}

/// The columns of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartColumns<'a> {
    /// Name of the part in messages.
    pub name: &'a str,
    /// Number of particles.
    pub count: u64,
    /// Its columns; of several with one name, only the first counts.
    pub columns: Vec<ColumnShape<'a>>,
}
