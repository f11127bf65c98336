//! Grains: particles of any shape with an orientation, for simulations of granular matter, colloids and liquid crystals.
//!
//! All grains of a tree have one [`GrainShape`]. Each has a centre, an orientation, and a size per axis of its own. The
//! shape is defined once, in unit coordinates, and each ray is transformed into those of the grains that it may hit
//! (instancing; Rubin and Whitted, "A 3-dimensional representation for fast rendering of complex scenes", 1980).
//! Ellipsoids are intersected with 16 rays at once in f32 (`ellipsoid.rs`), all other shapes in f64 (`body`).
//!
//! A tree of boxes with eight children per node (`build.rs`, `node.rs`) is traversed with beams of rays (`walk.rs`).
//! With motion blur, each ray sees the grains at its own time; boxes contain them during the whole exposure.
//!
//! This example intersects a ray with one of two ellipsoids, which is rotated by a quarter turn about z:
//!
//! ```
//! use glam::Vec3;
//! use spherule_surface::Shape;
//! use spherule_surface::grains::{GrainShape, GrainSizes, GrainSurface, GrainTree, Grains};
//! use spherule_tree::ray::Ray;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let centers = [Vec3::ZERO, Vec3::new(9.0, 0.0, 0.0)];
//! let quarter_turn = [0.0, 0.0, 0.5_f32.sqrt(), 0.5_f32.sqrt()];
//! let grains = Grains {
//!     orientations: &[[0.0, 0.0, 0.0, 1.0], quarter_turn],
//!     ..Grains::new(&centers, GrainSizes::Common(Vec3::new(3.0, 1.0, 1.0)))
//! };
//! let tree = GrainTree::new(&grains, GrainShape::Ellipsoid)?;
//! assert!(tree.report().is_clean());
//! // The surface is a shape like the others of a scene
//! let surface = GrainSurface::new(&tree);
//! let hit = surface.nearest(&Ray::new(Vec3::new(9.0, -7.0, 0.0), Vec3::Y)).expect("a hit");
//! assert_eq!(hit.particle, 1);
//! assert!((hit.t - 4.0).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```

use std::fmt;
use std::sync::Arc;

use glam::Vec3;

mod body;
mod bounds;
mod build;
mod check;
mod ellipsoid;
mod instance;
mod mesh;
mod motion;
mod node;
mod pose;
mod rays;
mod shape;
mod solid;
mod tree;
mod walk;

#[cfg(test)]
mod tests;

pub use check::{GrainError, GrainReport};
pub use mesh::{
    GrainMesh, GrainMeshError, GrainSphere, MAX_GRAIN_SPHERES, MAX_GRAIN_TRIANGLES, MAX_HULL_POINTS,
};
pub use motion::rotation_between;
pub use shape::GrainSurface;
pub use tree::GrainTree;

/// The shape of all grains of a tree. Semi-axes are those of [`Grains::sizes`]: half the size of the grain along each
/// of its own axes, before it is rotated.
#[derive(Clone, Default)]
pub enum GrainShape {
    /// Ellipsoids.
    #[default]
    Ellipsoid,
    /// Superquadrics: `(|x/a|^n2 + |y/b|^n2)^(n1/n2) + |z/c|^n1 = 1` for semi-axes a, b, c.
    Superquadric {
        /// `[n1, n2]`, each at least 1, if [`Grains::exponents`] has none: n1 is the exponent along z, n2 that of the
        /// cross section in x and y. This is the convention of Podlozhnyuk, Pirker and Kloss, "Efficient implementation of
        /// superquadric particles in Discrete Element Method within an open-source framework" (2017), and of
        /// `blockiness1` and `blockiness2` in LIGGGHTS. 2 and 2 are an ellipsoid; large exponents approach a cuboid.
        exponents: [f32; 2],
    },
    /// Capsules along z: the semi-axis of z contains the caps, and that of x is the radius. If x and y differ, the cross
    /// section is an ellipse. If z is shorter than x, the grain is an ellipsoid.
    Capsule,
    /// Cylinders along z with flat caps and an elliptical cross section.
    Cylinder,
    /// Cuboids.
    Cuboid,
    /// A closed mesh. The semi-axes are factors on its coordinates, and its origin is the centre of the grain.
    Mesh(Arc<GrainMesh>),
}

impl fmt::Debug for GrainShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ellipsoid => f.write_str("Ellipsoid"),
            Self::Superquadric { exponents } => write!(f, "Superquadric({exponents:?})"),
            Self::Capsule => f.write_str("Capsule"),
            Self::Cylinder => f.write_str("Cylinder"),
            Self::Cuboid => f.write_str("Cuboid"),
            Self::Mesh(mesh) => write!(f, "Mesh({} triangles)", mesh.triangle_count()),
        }
    }
}

/// Sizes of grains, scene units.
#[derive(Debug, Clone, Copy)]
pub enum GrainSizes<'a> {
    /// The same semi-axes for all grains.
    Common(Vec3),
    /// Semi-axes of each grain.
    Each(&'a [[f32; 3]]),
}

/// Grains of one time step, one array per property. Arrays have one element per grain, in particle order.
#[derive(Debug, Clone, Copy)]
pub struct Grains<'a> {
    /// Centres, relative to the origin of the sequence, scene units.
    pub centers: &'a [Vec3],
    /// Unit quaternions x, y, z, w that rotate a grain from its own axes into the scene; empty for grains that are not
    /// rotated.
    pub orientations: &'a [[f32; 4]],
    /// Semi-axes, or factors on the coordinates of a mesh.
    pub sizes: GrainSizes<'a>,
    /// Exponents `[n1, n2]` of superquadrics; empty for those of the shape.
    pub exponents: &'a [[f32; 2]],
    /// How grains move while the shutter is open.
    pub motion: Option<GrainMotion<'a>>,
}

impl<'a> Grains<'a> {
    /// Grains that are not rotated and do not move.
    pub const fn new(centers: &'a [Vec3], sizes: GrainSizes<'a>) -> Self {
        Self { centers, orientations: &[], sizes, exponents: &[], motion: None }
    }
}

/// Motion of grains from the opening of the shutter to its closing. Centres and orientations of [`Grains`] are those in
/// the middle of the exposure. Both change at a constant rate.
#[derive(Debug, Clone, Copy)]
pub struct GrainMotion<'a> {
    /// Displacements, scene units; empty for none.
    pub displacements: &'a [Vec3],
    /// Rotations about an axis through the centre, as vectors along that axis in the scene with the angle as their
    /// length, radians: the angular velocity times the duration of the exposure, or [`rotation_between`]. Angles above
    /// eight turns count as eight turns, which look the same. Empty for none.
    pub rotations: &'a [Vec3],
}
