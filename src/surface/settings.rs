//! What is asked of a surface, whatever builds it.

/// What rays meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SurfaceKind {
    /// Spheres, each a body of its own.
    #[default]
    Spheres,
    /// The union of the spheres: one connected body.
    Union,
    /// The isosurface of the particles' SPH colour field.
    Smooth,
}

/// Which way a surface is said to face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NormalKind {
    /// What is usual for the surface: spheres' own, of a smooth surface the field's.
    #[default]
    Auto,
    /// Of the sphere that is met.
    Sphere,
    /// Against the gradient of the SPH colour field.
    Field,
    /// By principal components of the neighbours (Xiao et al. 2017).
    Pca,
}

/// Everything that decides a surface beside particles and radii. Lengths are in particle radii, as
/// in splashsurf, so that its users can bring theirs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSettings {
    /// What rays meet.
    pub kind: SurfaceKind,
    /// Which way it faces.
    pub normals: NormalKind,
    /// From 0 (every particle shows) to 1 (calm bulk water): how much crowded particles are smoothed.
    pub smoothing: f32,
    /// Takes places and normals from the particles instead of the grid, of the field without smoothing.
    pub exact: bool,
    /// Edge of a voxel of the grid.
    pub voxel: f32,
    /// Smoothing length `h` of the cubic spline, whose support is `2h`.
    pub smoothing_length: f32,
    /// Value of the colour field at the surface; inside it is about 1.
    pub threshold: f32,
    /// Whether particles with few neighbours are white spheres beside the surface, no part of it.
    pub spray: bool,
}

impl SurfaceSettings {
    /// Spheres; and what a smooth surface looks best with.
    pub const DEFAULT: Self = Self {
        kind: SurfaceKind::Spheres,
        normals: NormalKind::Auto,
        smoothing: 0.75,
        exact: false,
        voxel: 1.0,
        smoothing_length: 2.0,
        threshold: 0.6,
        spray: false,
    };
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
