//! Surfaces for ray tracing. A scene is a list of [`Shape`]s that intersect packets of rays. Every [`Intersection`]
//! has a distance, a normal, a material, and a particle that provides attributes, whatever shape it belongs to.

pub mod contact;
pub mod cut;
pub mod field;
mod gradient;
pub mod grains;
mod hierarchy;
mod intersections;
pub mod mesh;
pub mod moving;
mod neighbours;
mod normals;
mod owned;
mod owners;
mod pca;
mod plane;
pub mod rods;
mod settings;
mod shape;
mod size;
pub mod slices;
pub mod smooth;
pub mod spheres;
pub mod spray;
mod transmittance;
pub mod union;

pub use crate::scene::MaterialId;
pub use gradient::GradientNormals;
pub use intersections::{Intersection, Intersections};
pub use normals::ShadingNormals;
pub use owned::OwnedBody;
pub use owners::SphereOwners;
pub use pca::PcaNormals;
pub use plane::Plane;
pub use settings::{NormalKind, SprayStyle, SurfaceBytes, SurfaceKind, SurfaceSettings};
pub use shape::{CutShape, Shape, Side, SphereEntries, SphereEntry};
pub use size::SurfaceSize;
pub(crate) use transmittance::TransmittanceProduct;
