//! Readers of foreign formats, one file each. Those of binary formats work on the whole uncompressed file in memory
//! (`&[u8]`), those of text on a `TextInput`, of which a window is in memory. They trust none of it: every count is
//! checked against the bytes that are there, or against a budget, before anything is allocated.
//!
//! Each reader module offers `steps` (what time steps the bytes hold) and `read` (one of them).
//! [`crate::detect::Format`] picks the module.

use std::ops::Range;

use crate::{MemoryBudget, ParseError};

pub mod bgeo;
mod category;
pub(crate) mod columns;
pub mod csv;
#[cfg(test)]
mod damage;
mod input;
pub mod lammps;
pub mod npy;
#[cfg(test)]
mod pieces;
pub mod ply;
pub(crate) mod remarks;
mod table;
mod text;
#[cfg(test)]
mod text_samples;
pub mod vtk;
pub mod vtk_xml;
pub mod xyz;

pub(crate) use input::{TextInput, stream_bytes};
pub(crate) use table::CUT_SHORT;

/// One time step inside a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Position among the steps of the file, from 0.
    pub index: usize,
    /// The bytes that hold it; the whole file for formats with one step a file.
    pub span: Range<usize>,
    /// Step number written in the file (LAMMPS `TIMESTEP`), if any.
    pub number: Option<i64>,
    /// Simulation time written in the file, if cheap to find.
    pub time: Option<f64>,
}

impl Step {
    /// Adds a step in `span` to those of a file.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`] if the list of them needs more memory than `budget` allows.
    pub(crate) fn push(
        steps: &mut Vec<Self>,
        span: Range<usize>,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        // Sequences make a list of their own.
        let need = 4 * size_of::<Self>() * (steps.len() + 1);
        budget.check(need as u64, "the list of its steps is")?;
        let index = steps.len();
        steps.push(Self {
            index,
            span,
            number: None,
            time: None,
        });
        Ok(())
    }

    /// The only step of a file of `len` bytes.
    pub fn whole(len: usize) -> Self {
        Self {
            index: 0,
            span: 0..len,
            number: None,
            time: None,
        }
    }
}
