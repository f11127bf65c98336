//! Matte surfaces: Lambert's law. The same fraction of the light, the albedo, leaves in every direction.

use std::f32::consts::FRAC_1_PI;

use super::microfacet::dot;
use super::point::{PointBsdf, PointSample, SampledBsdf, SurfacePoint};
use crate::render::shading::{disc, to_world};

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matte;

impl PointBsdf for Matte {
    #[inline(always)]
    fn value(&self, at: &SurfacePoint, into: [f32; 3]) -> ([f32; 3], f32) {
        let cosine = dot(at.normal, into);
        let is_visible = cosine > 0.0 && at.is_above(into);
        let pdf = if is_visible { cosine * FRAC_1_PI } else { 0.0 };
        ([at.albedo[0] * pdf, at.albedo[1] * pdf, at.albedo[2] * pdf], pdf)
    }
}

impl SampledBsdf for Matte {
    #[inline(always)]
    fn sampled(&self, at: &SurfacePoint, u: [f32; 2]) -> PointSample {
        // Project a point of the disc up to the hemisphere (Malley's method)
        let [x, y] = disc(u);
        let rest = 1.0 - x * x - y * y;
        let z = (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let direction = to_world([x, y, z], at.normal);
        // Directions below the geometric surface have no light; the density cancels the cosine
        let is_visible = z > 0.0 && at.is_above(direction);
        let pdf = if is_visible { z * FRAC_1_PI } else { 0.0 };
        PointSample { direction, weight: at.albedo, pdf }
    }
}
