//! Readers of foreign formats, one file each. All work on the whole uncompressed file in memory
//! (`&[u8]`) and trust none of it: every count is checked against the bytes that are there before
//! anything is allocated.
//!
//! Each reader module offers `steps` (what time steps the bytes hold) and `read` (one of them).
//! [`crate::detect::Format`] picks the module.

use std::ops::Range;

pub mod bgeo;
mod category;
pub(crate) mod columns;
pub mod csv;
#[cfg(test)]
mod damage;
pub mod lammps;
pub mod npy;
pub mod ply;
pub(crate) mod remarks;
mod table;
mod text;
#[cfg(test)]
mod text_samples;
pub mod vtk;
pub mod vtk_xml;
pub mod xyz;

pub(crate) use table::stream_bytes;

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
