//! Plastic: a clear rough coat over a matte base. With a smooth surface it is glossy, with a rough one satin.
//!
//! The base gets the light that the coat does not reflect, so that no light is lost or gained, and the two directions
//! can be exchanged (Kelemen and Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with Importance
//! Sampling", 2001).

use std::f32::consts::FRAC_1_PI;

use super::microfacet::{
    Albedo, Ggx, choose, cosine_direction, dot, mirror, normalized, schlick_rise, select,
};
use super::point::LocalBsdf;
use spherule_tree::math::larger;

/// Reflectance of the coat at normal incidence. That of most plastics is 0.04, which veils dark colours of a colour
/// map.
const COAT: f32 = 0.02;

/// See the module.
#[derive(Debug, Clone)]
pub(super) struct Plastic {
    ggx: Ggx,
    coat: Albedo,
}

impl Plastic {
    /// Plastic with a roughness of 0 to 1.
    pub(super) fn new(roughness: f32) -> Self {
        let ggx = Ggx::new(roughness);
        Self { coat: Albedo::new(&ggx, COAT), ggx }
    }

    /// The light that leaves the coat, by the cosine of the direction.
    pub(super) const fn leaving(&self) -> &Albedo {
        &self.coat
    }

    /// The probability with which a direction of the base is sampled.
    #[inline(always)]
    fn base_part(&self, base: [f32; 3], out: f32) -> f32 {
        let coat = self.coat.at(out);
        let matte = (1.0 - coat) * larger(larger(base[0], base[1]), base[2]);
        matte / (matte + coat)
    }

    /// The BSDF of the coat, and that of a white base, times the cosine of `into`. `h` is the half vector.
    #[inline(always)]
    fn lobes(&self, out: [f32; 3], into: [f32; 3], h: [f32; 3]) -> (f32, f32) {
        let fresnel = COAT + (1.0 - COAT) * schlick_rise(dot(out, h));
        let shadowing = self.ggx.shadowing(out[2], into[2]);
        let coat = fresnel * self.ggx.density(h[2]) * shadowing / (4.0 * out[2]);
        // Attenuate the light of the base by the coat, on its way in and out
        let (there, back) = (1.0 - self.coat.at(out[2]), 1.0 - self.coat.at(into[2]));
        let cosine = into[2] * FRAC_1_PI;
        (coat, cosine * there * back / (1.0 - self.coat.mean))
    }
}

/// The half vector of two directions.
#[inline(always)]
fn half_vector(out: [f32; 3], into: [f32; 3]) -> [f32; 3] {
    normalized([out[0] + into[0], out[1] + into[1], out[2] + into[2]])
}

impl LocalBsdf for Plastic {
    #[inline(always)]
    fn value(&self, base: [f32; 3], out: [f32; 3], into: [f32; 3]) -> ([f32; 3], f32) {
        let h = half_vector(out, into);
        let (coat, matte) = self.lobes(out, into, h);
        let cosine = into[2] * FRAC_1_PI;
        let part = self.base_part(base, out[2]);
        let pdf = part * cosine + (1.0 - part) * self.ggx.pdf(h[2], out[2]);
        let value = [base[0] * matte + coat, base[1] * matte + coat, base[2] * matte + coat];
        (value, pdf)
    }

    #[inline(always)]
    fn direction(&self, base: [f32; 3], out: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        let (is_base, u) = choose(self.base_part(base, out[2]), u);
        let mirrored = mirror(out, self.ggx.sample_normal(out, u));
        let matte = cosine_direction(u);
        select(is_base, matte, mirrored)
    }

    fn diffuse_part(&self, base: [f32; 3], out: [f32; 3], into: [f32; 3]) -> [f32; 3] {
        let (coat, matte) = self.lobes(out, into, half_vector(out, into));
        base.map(
            |base| {
                if base * matte + coat > 0.0 { base * matte / (base * matte + coat) } else { 1.0 }
            },
        )
    }
}
