//! Shapes that rays intersect, from particles to meshes.
//!
//! ```text
//! tree, grids, meshes -> [surface] -> Shape -> tracer
//! ```
//!
//! A scene is a list of [`Shape`]s, which intersect packets of rays. Every [`Intersection`] has a distance, a normal, and
//! a particle that provides attributes, whatever shape it belongs to. A shape has a [`MaterialId`]. What a material looks
//! like, and how light travels between shapes, the crate leaves to `spherule-tracer`.
//!
//! - Spheres: [`spheres`], [`union`](mod@union) of those that overlap, [`spray`], [`whitewater`],
//!   [`moving`] ones, [`cut`] ones.
//! - [`smooth`]: the isosurface of the [`field`](mod@field) of particles, on a sparse grid.
//! - [`grains`]: ellipsoids, superquadrics, capsules, cylinders, cuboids and meshes with a place and orientation each.
//! - [`mesh`], [`rods`] and the ground [`Plane`].
//! - [`slices`]: a surface that changes during the exposure, as one per motion segment. [`clumps`]: what is apart from it
//!   and moves continuously.
//! - [`PcaNormals`], [`GradientNormals`]: normals of a fluid for its spheres. [`OwnedBody`], [`SphereOwners`]: the
//!   particles of a shape among those of a frame. [`contact`]: where the fluid touches the ground.
//!
//! Rays find the same surface alone and in packets, and with any number of threads. This crate takes slices and returns
//! values: it opens no files and prints nothing. ARCHITECTURE.md has its invariants.
//!
//! This example intersects a ray with two balls, and with the body that they form:
//!
//! ```
//! use glam::Vec3;
//! use spherule_surface::spheres::SphereSurface;
//! use spherule_surface::union::UnionSurface;
//! use spherule_surface::{MaterialId, Shape, Side};
//! use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
//! use spherule_tree::ray::Ray;
//!
//! let centers = [Vec3::ZERO, Vec3::X];
//! let balls = Spheres { centers: &centers, radius: SphereRadius::Common(0.75) };
//! let mut builder = TreeBuilder::new();
//! builder.build(&balls, &BuildSettings::default());
//!
//! let spheres = SphereSurface::new(builder.tree().view());
//! let ray = Ray::new(Vec3::new(-4.0, 0.0, 0.0), Vec3::X);
//! let hit = spheres.crossing(&ray, Side::Outside).expect("a hit");
//! assert_eq!((hit.t, hit.normal, hit.particle), (3.25, -Vec3::X, 0));
//! assert_eq!(spheres.material(), MaterialId::PARTICLES);
//!
//! // From the inside of the first ball, the ray leaves the union at the end of the second
//! let union = UnionSurface::new(builder.tree().view());
//! let inside = Ray { t_min: 4.0, ..ray };
//! assert_eq!(union.crossing(&inside, Side::Inside).expect("a way out").t, 5.75);
//! ```
#![deny(unsafe_code)]

pub mod clumps;
pub mod contact;
pub mod cut;
pub mod field;
mod gradient;
pub mod grains;
mod hierarchy;
mod intersections;
mod material_id;
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
pub mod whitewater;

pub use gradient::GradientNormals;
pub use intersections::{Intersection, Intersections};
pub use material_id::MaterialId;
pub use normals::ShadingNormals;
pub use owned::OwnedBody;
pub use owners::SphereOwners;
pub use pca::PcaNormals;
pub use plane::{Plane, PlaneSettings};
pub use settings::{NormalKind, SprayStyle, SurfaceBytes, SurfaceKind, SurfaceSettings};
pub use shape::{CutShape, Shape, Side, SphereEntries, SphereEntry};
pub use size::SurfaceSize;
pub use transmittance::TransmittanceProduct;
