//! Foam and spray: white scattering without a hard boundary between lit and unlit. Light is scattered from both sides
//! of the surface, the more the closer it is to the normal (wrapped diffuse reflection: Miller et al., "Interactive
//! Editing and Modeling of Bidirectional Texture Functions", in a form that conserves energy).
//!
//! With the cosine `c` between light and normal, the value is `albedo * (c + w) / (pi * (1 + w)^2)` for `c` above `-w`.

use std::f32::consts::{FRAC_1_PI, PI};

use super::microfacet::dot;
use super::point::{PointBsdf, PointSample, SampledBsdf, SurfacePoint};
use crate::render::shading::to_world;
use spherule_tree::math::functions::sin_cos;

/// Distance by which light wraps around the silhouette, 0 (matte) to 1 (from all directions); tuned by eye.
const WRAP: f32 = 0.7;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct Foam;

impl PointBsdf for Foam {
    #[inline(always)]
    fn value(&self, at: &SurfacePoint, into: [f32; 3]) -> ([f32; 3], f32) {
        let pdf = density(dot(at.normal, into));
        ([at.albedo[0] * pdf, at.albedo[1] * pdf, at.albedo[2] * pdf], pdf)
    }
}

impl SampledBsdf for Foam {
    #[inline(always)]
    fn sampled(&self, at: &SurfacePoint, u: [f32; 2]) -> PointSample {
        // The part of the light below a cosine c is ((c + w) / (1 + w))^2
        let z = (1.0 + WRAP) * u[0].sqrt() - WRAP;
        let rest = 1.0 - z * z;
        let level = (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let (sin, cos) = sin_cos(2.0 * PI * u[1]);
        let direction = to_world([level * cos, level * sin, z], at.normal);
        PointSample { direction, weight: at.albedo, pdf: density(z) }
    }
}

/// The value for the albedo 1, which is the probability density of the direction.
#[inline(always)]
fn density(cosine: f32) -> f32 {
    let above = cosine + WRAP;
    let above = if above > 0.0 { above } else { 0.0 };
    above * (FRAC_1_PI / ((1.0 + WRAP) * (1.0 + WRAP)))
}
