//! What rays meet: a scene is a list of [`Shape`]s, which answer for packets of rays. Whatever made an
//! [`Intersection`], it is a distance, a normal, a material, and a particle to take attributes from.

mod dimming;
pub mod field;
mod gradient;
mod intersections;
mod neighbours;
mod normals;
mod pca;
mod plane;
mod settings;
mod shape;
pub mod smooth;
pub mod spheres;
pub mod spray;
pub mod union;

pub(crate) use dimming::Dimming;
pub use gradient::GradientNormals;
pub use intersections::{Intersection, Intersections, MaterialId};
pub use normals::ShadingNormals;
pub use pca::PcaNormals;
pub use plane::Plane;
pub use settings::{NormalKind, SurfaceKind, SurfaceSettings};
pub use shape::{Shape, Side};
