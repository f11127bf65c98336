//! One time step of a particle simulation in memory, whatever file it comes from.
//!
//! ```text
//! readers, hdf5 -> RawParticles  [frame]  ParticleFrame -> selection, survey, spherule -> tree
//! ```
//!
//! A reader returns [`RawParticles`]: positions in the type of the file, and [`Attribute`]s, which are named arrays with
//! a number of components per particle. [`ParticleFrame`] is what the renderer needs of it: finite positions in f32,
//! relative to the origin that a sequence has in common ([`choose_origin`]). A [`SimulationCell`] and [`Bond`]s come
//! with molecular simulations; [`PeriodicImages`] wraps particles into the cell, makes molecules whole, and copies it; [`center`]
//! and [`superpose`] keep a group of particles in place. [`masses`] tells elements by their masses.
//!
//! This crate knows neither files nor rays. It uses only `spherule-files`.
//!
//! ```
//! use glam::{DVec3, Vec3};
//! use spherule_frame::{Attribute, AttributeData, ParticleFrame, Positions, RawParticles};
//!
//! let particles = RawParticles {
//!     positions: Positions::F32(vec![Vec3::ZERO, Vec3::X, Vec3::NAN]),
//!     attributes: vec![Attribute {
//!         name: "density".to_owned(),
//!         components: 1,
//!         data: AttributeData::F32(vec![998.0, 1001.0, 1004.0]),
//!     }],
//!     ..RawParticles::default()
//! };
//! let frame = ParticleFrame::from_raw(particles, DVec3::ZERO);
//! // A particle without a place is left out, with its attributes
//! assert_eq!((frame.positions.len(), frame.dropped), (2, 1));
//! assert_eq!(frame.attributes[0].data, AttributeData::F32(vec![998.0, 1001.0]));
//! ```
#![deny(unsafe_code)]

mod attribute;
mod bond_lengths;
pub mod bonds;
mod budget;
mod cell;
pub mod center;
mod decode;
mod error;
mod frame;
pub mod gather;
pub mod generate;
pub mod grain_columns;
mod images;
pub mod join;
mod labels;
mod lattice;
pub mod masses;
pub mod names;
mod origin;
pub mod reading;
mod sampling;
mod scalar;
pub mod superpose;
mod type_shapes;
pub mod values;
mod vectors;
mod whole;

pub use attribute::{Attribute, AttributeData};
pub use bond_lengths::BondLengths;
pub use bonds::Bond;
pub use budget::MemoryBudget;
pub use cell::SimulationCell;
pub use error::{FrameError, ParseError};
pub use frame::{
    FARTHEST, ParticleFrame, PositionSlice, Positions, Radius, RawParticles, find_radius, is_near,
    is_radius,
};
pub use images::PeriodicImages;
pub use labels::{Labels, label_code, next_label_code};
pub use lattice::Lattice;
pub use origin::choose_origin;
pub use sampling::sample_indices;
pub use scalar::{Endian, ScalarType};
pub use type_shapes::{TypeShape, TypeShapes};
pub use vectors::join_vectors;
pub use whole::Molecules;
