//! Readers of foreign formats, one file each: implementations of `Reader`.
//!
//! Readers of binary formats work on the whole uncompressed file (`&[u8]`), readers of text on a `TextInput`, which
//! holds a window of the file in memory. They trust none of it: they check every count against the bytes that are
//! there, or against a budget, before they allocate.

pub mod amber;
mod atoms;
mod beads;
pub mod bgeo;
pub mod bi4;
mod category;
#[cfg(test)]
mod cell_tests;
pub mod charmm_crd;
pub mod columns;
pub mod csv;
#[cfg(test)]
mod damage;
pub mod dcd;
pub mod dl_poly;
pub mod e57;
mod fixed_rows;
pub mod gadget;
pub mod gro;
pub mod gromos;
pub mod gsd;
pub mod houdini;
mod input;
pub mod lammps;
pub mod las;
mod line_words;
pub mod lzf;
pub mod mdcrd;
pub mod mmcif;
pub mod mol2;
#[cfg(test)]
mod molecule_tests;
pub mod notes;
pub mod npy;
mod numbers;
pub mod openpmd_json;
pub mod pcd;
pub mod pdb;
#[cfg(test)]
mod pieces;
pub mod ply;
pub mod prmtop;
pub mod psf;
pub mod pts;
pub mod rst7;
pub mod sdf;
pub mod sniff;
mod source;
mod table;
pub mod text;
#[cfg(test)]
mod text_samples;
mod texts;
pub mod tinker;
pub mod tipsy;
pub mod trr;
mod typed_text;
pub mod usd;
pub mod vasp;
pub mod vtk;
pub mod vtk_xml;
mod xdr;
pub mod xtc;
pub mod xyz;

pub use beads::bead_name;
pub use category::{element_symbol, name_code};
pub use input::{TextInput, stream_bytes};
pub use source::ByteSource;
pub use table::CUT_SHORT;

pub use crate::step::Step;
