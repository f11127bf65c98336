//! Writers of foreign formats, to compare particles in other programs. Files appear complete or not at all.
//! [`crate::native`] writes native frames.

pub mod npy;
pub mod vtk;

mod stream;
