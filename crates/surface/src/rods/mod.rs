//! Rods: cylinders, cones and capsules with a radius at each end, for the edges of a simulation cell, bonds, arrows and
//! trails.
//!
//! Each rod is a convex body, and a ray passes through it on one interval (`interval.rs`), which is computed in f64
//! from the point of the ray closest to the rod. The surfaces of a rod leave no gap between them, and rods far from the
//! origin are as exact as their coordinates.

use std::fmt;

use glam::{DVec3, Vec3};

mod arrow;
mod interval;
mod part_tree;
mod parts;
mod shape;

#[cfg(test)]
mod tests;

pub use arrow::{Anchor, arrow};
pub use shape::RodSurface;

use interval::Body;
use part_tree::PartTree;
use parts::parts_of;

/// The shape of both ends of a rod.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Caps {
    /// None: a pipe that one can look into.
    Open,
    /// Discs: a cylinder, or a cone if one radius is 0.
    Flat,
    /// Spheres around the ends: a capsule. If the radii differ, the rod is the convex hull of both spheres.
    Round,
}

/// A rod.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rod {
    /// Its ends, relative to the origin of the sequence, scene units.
    pub ends: [Vec3; 2],
    /// Its radius at each end, scene units.
    pub radii: [f32; 2],
    /// The particles that give each half its colour and other attributes, or indices of its
    /// [colours](RodTree::with_colors).
    pub particles: [u32; 2],
}

impl Rod {
    /// A rod of one radius that belongs to no particle.
    pub const fn line(ends: [Vec3; 2], radius: f32) -> Self {
        Self { ends, radii: [radius; 2], particles: [0; 2] }
    }

    /// Whether rays can hit it: its values are finite, no radius is negative, one of them is positive, and it has a
    /// length unless its caps are round.
    fn is_visible(&self, caps: Caps) -> bool {
        let is_finite = self.ends.iter().all(|end| end.is_finite())
            && self.radii.iter().all(|radius| radius.is_finite());
        let has_radius =
            self.radii.iter().all(|r| *r >= 0.0) && self.radii.iter().any(|r| *r > 0.0);
        is_finite && has_radius && (caps == Caps::Round || self.ends[0] != self.ends[1])
    }
}

/// Greatest number of rods; long ones have several parts each.
pub const MAX_RODS: usize = u32::MAX as usize / 2;

/// Rods with caps of one kind, and a tree of their parts.
pub struct RodTree {
    rods: Vec<Rod>,
    /// Base colours, linear RGB; empty if all rods have that of their material.
    colors: Vec<Vec3>,
    caps: Caps,
    parts: PartTree,
    /// The largest coordinate of their boxes.
    extent: f32,
}

impl fmt::Debug for RodTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RodTree")
            .field("rods", &self.rods.len())
            .field("caps", &self.caps)
            .finish_non_exhaustive()
    }
}

impl RodTree {
    /// Builds the tree of `rods`, without those that no ray can hit, and of at most [`MAX_RODS`].
    pub fn new(mut rods: Vec<Rod>, caps: Caps) -> Self {
        rods.retain(|rod| rod.is_visible(caps));
        rods.truncate(MAX_RODS);
        let divided = parts_of(&rods, extent_of(&rods));
        let parts = PartTree::new(&divided, &rods, caps);
        let extent =
            parts.bounds().map_or(0.0, |[min, max]| min.abs().max(max.abs()).max_element());
        Self { rods, colors: Vec::new(), caps, parts, extent }
    }

    /// Gives each half of a rod the base colour at its index of [`Rod::particles`], linear RGB; halves without one keep
    /// that of the material.
    #[must_use]
    pub fn with_colors(self, colors: Vec<Vec3>) -> Self {
        Self { colors, ..self }
    }

    /// Number of rods.
    pub const fn len(&self) -> usize {
        self.rods.len()
    }

    /// Whether there are none.
    pub const fn is_empty(&self) -> bool {
        self.rods.is_empty()
    }

    /// The lowest and the highest corner of their box; None without rods.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        self.parts.bounds()
    }

    /// Memory of the rods, their colours and their tree, bytes.
    pub const fn bytes(&self) -> usize {
        let colors = size_of_val(self.colors.as_slice());
        size_of_val(self.rods.as_slice()) + colors + self.parts.bytes()
    }

    /// Upper bounds of the memory of `rods` rods with so many `colors`, bytes: while the tree is built, and afterwards.
    pub fn predicted_bytes(rods: u64, colors: u64) -> [u64; 2] {
        let own = rods.saturating_mul(size_of::<Rod>() as u64);
        let colors = colors.saturating_mul(size_of::<Vec3>() as u64);
        PartTree::predicted_bytes(rods).map(|tree| tree.saturating_add(own).saturating_add(colors))
    }

    /// The body of the rod with this index.
    fn body(&self, rod: u32) -> Body {
        Body::new(&self.rods[rod as usize], self.caps)
    }
}

/// The largest side of the box of the ends of `rods`.
fn extent_of(rods: &[Rod]) -> f64 {
    let ends = rods.iter().flat_map(|rod| rod.ends.map(double));
    let corners = ends.map(|end| [end; 2]);
    let bounds = corners.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    bounds.map_or(0.0, |[min, max]| (max - min).max_element())
}

/// `vector` in double precision.
fn double(vector: Vec3) -> DVec3 {
    vector.as_dvec3()
}
