//! Settings of a surface, for all kinds.

/// Kinds of surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SurfaceKind {
    /// Spheres, each a separate body.
    #[default]
    Spheres,
    /// The union of the spheres: one connected body.
    Union,
    /// The isosurface of the particles' SPH colour field.
    Smooth,
}

/// Kinds of normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NormalKind {
    /// The default of the surface: the normals of the spheres, or those of the field for a smooth surface.
    #[default]
    Auto,
    /// The normal of the sphere that is hit.
    Sphere,
    /// Against the gradient of the SPH colour field.
    Field,
    /// By principal components of the neighbours (Xiao et al. 2017).
    Pca,
}

/// How foam and spray are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SprayStyle {
    /// Drops of different sizes that fade out towards their silhouettes.
    #[default]
    Soft,
    /// White spheres.
    Spheres,
}

/// Memory of a surface, without trees of spheres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SurfaceBytes {
    /// During its build.
    pub building: u64,
    /// During tracing.
    pub kept: u64,
}

/// Everything that defines a surface apart from particles and radii. Lengths are in particle radii, as in splashsurf,
/// so that its parameters can be used here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSettings {
    /// The kind of surface.
    pub kind: SurfaceKind,
    /// The kind of normals.
    pub normals: NormalKind,
    /// Smoothing of crowded particles, from 0 (every particle is visible) to 1 (calm bulk water).
    pub smoothing: f32,
    /// Compute points and normals from the particles and not from the grid, for the field without smoothing.
    pub exact: bool,
    /// Edge of a voxel of the grid.
    pub voxel: f32,
    /// Smoothing length `h` of the cubic spline, whose support is `2h`.
    pub smoothing_length: f32,
    /// Value of the colour field at the surface; inside it is about 1.
    pub threshold: f32,
    /// Draw particles with few neighbours as white drops that are not part of the surface.
    pub spray: bool,
    /// How these, and whitewater, are drawn.
    pub spray_style: SprayStyle,
    /// Draw spray, foam and bubbles where the flow mixes with air.
    pub whitewater: bool,
    /// Speed of violent water, to which the speeds of whitewater are relative, scene units per unit of time; None until it
    /// is known.
    pub whitewater_speed: Option<f32>,
    /// Factor on the number of drops of whitewater.
    pub whitewater_amount: f32,
    /// Factor on the radii of these drops.
    pub whitewater_size: f32,
}

impl SurfaceSettings {
    /// Spheres, and the values with which a smooth surface looks best.
    pub const DEFAULT: Self = Self {
        kind: SurfaceKind::Spheres,
        normals: NormalKind::Auto,
        smoothing: 0.75,
        exact: false,
        voxel: 1.0,
        smoothing_length: 2.0,
        threshold: 0.6,
        spray: false,
        spray_style: SprayStyle::Soft,
        whitewater: false,
        whitewater_speed: None,
        whitewater_amount: 1.0,
        whitewater_size: 1.0,
    };

    /// Support of the SPH kernel in particle radii.
    pub const fn support(&self) -> f32 {
        2.0 * self.smoothing_length
    }
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
