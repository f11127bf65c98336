//! Metals: mirrors of microfacets in the base colour.
//!
//! Light that is reflected several times between microfacets is added, so that rough metals do not lose it (Kulla and
//! Conty, "Revisiting Physically Based Shading at Imageworks", 2017).

use std::f32::consts::FRAC_1_PI;

use super::microfacet::{
    Albedo, Ggx, choose, cosine_direction, dot, mirror, normalized, schlick_rise, select,
};
use super::point::LocalBsdf;
use spherule_tree::math::larger;

/// See the module.
#[derive(Debug, Clone)]
pub(super) struct Metal {
    ggx: Ggx,
    /// For a reflectance of 1.
    albedo: Albedo,
}

impl Metal {
    /// A metal with a roughness of 0 to 1.
    pub(super) fn new(roughness: f32) -> Self {
        let ggx = Ggx::new(roughness);
        Self { albedo: Albedo::new(&ggx, 1.0), ggx }
    }

    /// The light that leaves by one reflection, by the cosine of the direction.
    pub(super) const fn leaving(&self) -> &Albedo {
        &self.albedo
    }

    /// The fraction of light that does not leave after one reflection if all of it is reflected. It is also the
    /// probability with which a direction is sampled for light of several reflections.
    #[inline(always)]
    fn lost(&self, cosine: f32) -> f32 {
        larger(1.0 - self.albedo.at(cosine), 0.0)
    }
}

impl LocalBsdf for Metal {
    #[inline(always)]
    fn value(&self, f0: [f32; 3], out: [f32; 3], into: [f32; 3]) -> ([f32; 3], f32) {
        let h = normalized([out[0] + into[0], out[1] + into[1], out[2] + into[2]]);
        let density = self.ggx.density(h[2]);
        let single = density * self.ggx.shadowing(out[2], into[2]) / (4.0 * out[2]);
        let rise = schlick_rise(dot(out, h));
        // Add light of several reflections
        let lost = [self.lost(out[2]), self.lost(into[2])];
        let mean = self.albedo.mean;
        let several = lost[0] * lost[1] * into[2] * FRAC_1_PI / larger(1.0 - mean, 1e-6);
        let mut value = [0.0; 3];
        for axis in 0..3 {
            let fresnel = f0[axis] + (1.0 - f0[axis]) * rise;
            let average = (20.0 * f0[axis] + 1.0) / 21.0;
            let tint = average * average * mean / (1.0 - average * (1.0 - mean));
            value[axis] = fresnel * single + tint * several;
        }
        let part = lost[0];
        let pdf = self.ggx.pdf(h[2], out[2]);
        (value, (1.0 - part) * pdf + part * into[2] * FRAC_1_PI)
    }

    #[inline(always)]
    fn direction(&self, _f0: [f32; 3], out: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        let (is_diffuse, u) = choose(self.lost(out[2]), u);
        let mirrored = mirror(out, self.ggx.sample_normal(out, u));
        let diffuse = cosine_direction(u);
        select(is_diffuse, diffuse, mirrored)
    }

    fn diffuse_part(&self, _f0: [f32; 3], _out: [f32; 3], _into: [f32; 3]) -> [f32; 3] {
        [0.0; 3]
    }
}
