//! Materials of meshes: tanks, obstacles and other bodies that are not particles.

use glam::Vec3;

use super::Finish;
use super::material::dielectric;

/// Default colour of meshes, linear RGB: a neutral light grey.
pub const DEFAULT_COLOR: Vec3 = Vec3::splat(0.6);

/// Index of refraction of panes.
const GLASS_IOR: f32 = 1.5;

/// How a mesh reflects and transmits light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeshFinish {
    /// An opaque surface. Only path tracing knows finishes; otherwise the mesh is matte.
    Opaque(Finish),
    /// A thin pane of glass: each surface stands for both sides of a wall, so that light passes without refraction.
    /// The colour is its transmittance, apart from reflections.
    Pane,
}

/// The material of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshMaterial {
    /// Base colour, or transmittance of a pane, linear RGB.
    pub color: Vec3,
    /// Reflection and transmission.
    pub finish: MeshFinish,
    /// Whether the mesh hides what is behind it from the camera without being visible itself.
    pub is_holdout: bool,
}

impl MeshMaterial {
    /// A matte mesh in the default colour.
    pub const DEFAULT: Self =
        Self { color: DEFAULT_COLOR, finish: MeshFinish::Opaque(Finish::Matte), is_holdout: false };

    /// Whether light passes through.
    pub fn is_pane(&self) -> bool {
        self.finish == MeshFinish::Pane
    }
}

impl Default for MeshMaterial {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The part of the light that a thin pane reflects, at the absolute `cosine` between ray and normal. Light that both
/// of its sides reflect any number of times is included.
pub fn pane_reflectance(cosine: f32) -> f32 {
    let once = dielectric(cosine, 1.0 / GLASS_IOR);
    2.0 * once / (1.0 + once)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panes_reflect_at_both_sides() {
        // By hand: 0.04 + 0.96^2 * 0.04 * (1 + 0.04^2 + 0.04^4 + ...) = 0.08 / 1.04
        assert!((pane_reflectance(1.0) - 0.08 / 1.04).abs() < 1e-6);
        assert!((pane_reflectance(0.0) - 1.0).abs() < 1e-6);
    }
}
