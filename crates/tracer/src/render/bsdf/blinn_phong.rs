//! Eq. 4.2 of the thesis: reflection of direct light by the model of Blinn and Phong, for the Whitted integrator. Paths
//! do not follow it, because it may reflect more light than arrives.

use super::microfacet::dot;
use super::point::{PointBsdf, SurfacePoint};
use crate::scene::Material;
use spherule_tree::math::functions::pow;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct BlinnPhong {
    /// `kd`.
    pub(in crate::render) diffuse: f32,
    /// `ks`.
    specular: f32,
    shininess: f32,
    /// Highlights up to this fraction of the light are ignored.
    pub(in crate::render) min_highlight: f32,
}

impl BlinnPhong {
    /// The reflection of a `material`.
    pub(in crate::render) fn new(material: &Material) -> Self {
        Self {
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            min_highlight: 0.0,
        }
    }

    /// The same without the highlight.
    pub(in crate::render) const fn matte(self) -> Self {
        Self { specular: 0.0, ..self }
    }

    /// Whether it reflects light.
    pub(in crate::render) fn scatters(&self) -> bool {
        self.diffuse > 0.0 || self.specular > 0.0
    }
}

impl PointBsdf for BlinnPhong {
    #[inline(always)]
    fn value(&self, at: &SurfacePoint, into: [f32; 3]) -> ([f32; 3], f32) {
        // The cosine is NaN at the exact position of a point light, which is then not facing
        let n = at.normal;
        let cosine = dot(n, into);
        let is_facing = cosine > 0.0;
        // Evaluate the highlight with the half vector
        let mut highlight = 0.0;
        if self.specular > 0.0 {
            let h = [into[0] + at.out[0], into[1] + at.out[1], into[2] + at.out[2]];
            let inverse = 1.0 / dot(h, h).sqrt();
            let along = dot(n, [h[0] * inverse, h[1] * inverse, h[2] * inverse]);
            // Without a half vector (a light straight behind the surface), use the normal
            let found = if inverse < f32::INFINITY { along } else { 1.0 };
            let above = if found > 0.0 { found } else { 0.0 };
            let power = pow(if above < 1.0 { above } else { 1.0 }, self.shininess);
            highlight = if power > self.min_highlight { self.specular * power } else { 0.0 };
        }
        let scattered = self.diffuse * cosine;
        let mut value = [0.0; 3];
        for axis in 0..3 {
            let reflected = scattered * at.albedo[axis] + highlight;
            value[axis] = if is_facing { reflected } else { 0.0 };
        }
        (value, 0.0)
    }
}
