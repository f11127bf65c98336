//! Shading normals of spheres.

use super::Intersection;
use super::gradient::GradientNormals;
use super::pca::PcaNormals;
use spherule_tree::accel::view::TreeView;
use spherule_tree::ray::Ray;

/// The kind of normals that shade surfaces of spheres. The geometric normals of the spheres always decide on which
/// side of a surface a ray is, and where the next ray starts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum ShadingNormals {
    /// The normal of the sphere.
    #[default]
    Sphere,
    /// Perpendicular to the plane in which the neighbouring particles lie.
    Pca(PcaNormals),
    /// Against the gradient of the field of the neighbouring particles.
    Gradient(GradientNormals),
}

impl ShadingNormals {
    /// `hit`, on a sphere of `radius` in `tree`, with its shading normal.
    #[inline]
    pub(super) fn shade(
        &self,
        tree: &TreeView,
        ray: &Ray,
        hit: Intersection,
        radius: f32,
    ) -> Intersection {
        match self {
            Self::Sphere => hit,
            Self::Pca(normals) => normals.shade(tree, ray, hit, radius),
            Self::Gradient(normals) => normals.shade(tree, ray, hit, radius),
        }
    }
}
