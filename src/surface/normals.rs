//! Which way spheres are said to face when they are shaded.

use super::Intersection;
use super::gradient::GradientNormals;
use super::pca::PcaNormals;
use crate::accel::view::TreeView;
use crate::ray::Ray;

/// Where the normals come from that surfaces of spheres are shaded by. What decides on which side of them a
/// ray is, and where the next one starts, is always the sphere's own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum ShadingNormals {
    /// The sphere's.
    #[default]
    Sphere,
    /// Across where the particles about the place lie flat.
    Pca(PcaNormals),
    /// Against the gradient of their field.
    Gradient(GradientNormals),
}

impl ShadingNormals {
    /// `hit`, on a sphere of `radius` in `tree`, with the normal that it is to be shaded by.
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
