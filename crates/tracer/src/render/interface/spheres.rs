//! The reflected and refracted rays of eq. 4.1 and 4.3 at opaque surfaces, and at spheres that are separate bodies.
//!
//! Normals face the ray, as those of the thesis's `faceforward` do. Under total internal reflection, `r` is 1.

use super::{Dielectric, Interface, LeavingRays};
use crate::render::bsdf::SurfacePoints;
use spherule_surface::Intersections;
use spherule_tree::math::{LANES, Lanes, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// The interface of a surface with two sides, see the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphereInterface(pub(super) Dielectric);

impl Interface for SphereInterface {
    fn dielectric(&self) -> &Dielectric {
        &self.0
    }

    fn leave(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        _inside: u32,
        _u: &[Lanes; 2],
        _points: &mut SurfacePoints,
        leaving: &mut LeavingRays,
    ) {
        reflected_rays(simd, &self.0, rays, hits, leaving);
        if self.0.transmission > 0.0 {
            refracted_rays(simd, &self.0, rays, hits, leaving);
        }
    }
}

/// Computes the rays that are reflected at intersections.
#[inline(always)]
fn reflected_rays_body(
    dielectric: &Dielectric,
    rays: &RayPacket,
    hits: &Intersections,
    leaving: &mut LeavingRays,
) {
    for l in 0..LANES {
        let d = [rays.direction[0][l], rays.direction[1][l], rays.direction[2][l]];
        let n = [hits.normal[0][l], hits.normal[1][l], hits.normal[2][l]];
        // Turn the normal to the side of the ray
        let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
        let is_entering = along < 0.0;
        let side = if is_entering { 1.0 } else { -1.0 };
        let cosine = if is_entering { -along } else { along };
        // Compute the Fresnel reflectance, 1 under total internal reflection
        let ratio = if is_entering { 1.0 / dielectric.ior } else { dielectric.ior };
        let (r, _) = dielectric.fresnel(cosine, ratio);
        // Compute the reflected direction, normalised so that errors do not accumulate along a path
        let twice = 2.0 * -cosine;
        let reflected = [
            d[0] - twice * (n[0] * side),
            d[1] - twice * (n[1] * side),
            d[2] - twice * (n[2] * side),
        ];
        let inverse = 1.0
            / (reflected[0] * reflected[0]
                + reflected[1] * reflected[1]
                + reflected[2] * reflected[2])
                .sqrt();
        for axis in 0..3 {
            let step = hits.offset[l] * (n[axis] * side);
            leaving.reflected.origin[axis][l] = hits.anchor[axis][l] + step;
            leaving.reflected.direction[axis][l] = reflected[axis] * inverse;
        }
        leaving.reflected.weight[l] = dielectric.reflection * r;
    }
}

lane_kernel! {
    fn reflected_rays(
        dielectric: &Dielectric,
        rays: &RayPacket,
        hits: &Intersections,
        leaving: &mut LeavingRays,
    ) = reflected_rays_body;
}

/// Computes the rays that spheres that are separate bodies refract.
#[inline(always)]
fn refracted_rays_body(
    dielectric: &Dielectric,
    rays: &RayPacket,
    hits: &Intersections,
    leaving: &mut LeavingRays,
) {
    for l in 0..LANES {
        let mut d = [0.0; 3];
        let mut n = [0.0; 3];
        for axis in 0..3 {
            d[axis] = rays.direction[axis][l];
            n[axis] = hits.normal[axis][l];
        }
        let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
        // Find the side of the ray, and the Fresnel reflectance
        let is_entering = along < 0.0;
        let side = if is_entering { 1.0 } else { -1.0 };
        let cosine = if is_entering { -along } else { along };
        let ratio = if is_entering { 1.0 / dielectric.ior } else { dielectric.ior };
        let (r, sin2_out) = dielectric.fresnel(cosine, ratio);
        // Compute the refracted direction by Snell's law
        let is_total = sin2_out >= 1.0;
        let along_normal = ratio * cosine - (1.0 - if is_total { 1.0 } else { sin2_out }).sqrt();
        let mut refracted = [0.0; 3];
        for axis in 0..3 {
            refracted[axis] = ratio * d[axis] + along_normal * (n[axis] * side);
        }
        // Normalise it so that errors do not accumulate along a path
        let length2 =
            refracted[0] * refracted[0] + refracted[1] * refracted[1] + refracted[2] * refracted[2];
        let inverse = 1.0 / length2.sqrt();
        for axis in 0..3 {
            let step = hits.offset[l] * (n[axis] * side);
            leaving.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            leaving.refracted.direction[axis][l] = refracted[axis] * inverse;
        }
        let weight = dielectric.transmission * (1.0 - r);
        leaving.refracted.weight[l] = if is_total { 0.0 } else { weight };
    }
}

lane_kernel! {
    fn refracted_rays(
        dielectric: &Dielectric,
        rays: &RayPacket,
        hits: &Intersections,
        leaving: &mut LeavingRays,
    ) = refracted_rays_body;
}
