//! Writers of foreign formats, for particles to be compared in other programs. Files appear whole
//! or not at all. Native frames are [`crate::native`]'s.

pub(crate) mod atomic;

pub use atomic::own_temporaries;

pub mod npy;
pub mod vtk;

mod stream;
