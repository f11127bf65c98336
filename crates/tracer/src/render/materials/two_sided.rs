//! Eq. 4.1 and 4.3 for opaque surfaces, and for spheres that are separate bodies.
//!
//! Normals face the ray, as those of the thesis's `faceforward` do, so that a surface seen from inside is lit from
//! inside. Under total internal reflection, `r` is 1.

use super::material::Material;
use super::points::ShadingPoints;
use super::whitted::WhittedMaterial;
use crate::surface::Intersections;
use spherule_tree::math::{LANES, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// The material of a two-sided surface, see the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct TwoSided(pub(super) WhittedMaterial);

impl Material for TwoSided {
    fn constants(&self) -> &WhittedMaterial {
        &self.0
    }

    fn shading_points(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        _inside: u32,
        points: &mut ShadingPoints,
    ) {
        reflected_rays(simd, &self.0, rays, hits, points);
        if self.0.dielectric.transmission > 0.0 {
            refracted_rays(simd, &self.0, rays, hits, points);
        }
    }
}

/// Computes shading points with reflected rays from intersections.
#[inline(always)]
fn reflected_rays_body(
    material: &WhittedMaterial,
    rays: &RayPacket,
    hits: &Intersections,
    points: &mut ShadingPoints,
) {
    for l in 0..LANES {
        let d = [rays.direction[0][l], rays.direction[1][l], rays.direction[2][l]];
        let n = [hits.normal[0][l], hits.normal[1][l], hits.normal[2][l]];
        let s = [hits.shading_normal[0][l], hits.shading_normal[1][l], hits.shading_normal[2][l]];
        // Turn both normals to the side of the ray
        let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
        let is_entering = along < 0.0;
        let side = if is_entering { 1.0 } else { -1.0 };
        let cosine = if is_entering { -along } else { along };
        let shading_along = d[0] * s[0] + d[1] * s[1] + d[2] * s[2];
        let shading_side = if shading_along < 0.0 { 1.0 } else { -1.0 };
        // Compute the Fresnel reflectance, 1 under total internal reflection
        let ratio =
            if is_entering { 1.0 / material.dielectric.ior } else { material.dielectric.ior };
        let (r, _) = material.dielectric.fresnel(cosine, ratio);
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
            // Offset the origins of reflected rays and shadow rays
            let start = hits.anchor[axis][l] + hits.offset[l] * (n[axis] * side);
            let normal = s[axis] * shading_side;
            points.normal[axis][l] = normal;
            points.start[axis][l] = start + hits.lift[l] * normal;
            points.reflected.origin[axis][l] = start;
            points.reflected.direction[axis][l] = reflected[axis] * inverse;
        }
        points.reflected.weight[l] = material.reflection * r;
    }
}

lane_kernel! {
    fn reflected_rays(
        material: &WhittedMaterial,
        rays: &RayPacket,
        hits: &Intersections,
        points: &mut ShadingPoints,
    ) = reflected_rays_body;
}

/// Computes the refracted rays at the shading points of spheres that are separate bodies.
#[inline(always)]
fn refracted_rays_body(
    material: &WhittedMaterial,
    rays: &RayPacket,
    hits: &Intersections,
    points: &mut ShadingPoints,
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
        let ratio =
            if is_entering { 1.0 / material.dielectric.ior } else { material.dielectric.ior };
        let (r, sin2_out) = material.dielectric.fresnel(cosine, ratio);
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
            points.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            points.refracted.direction[axis][l] = refracted[axis] * inverse;
        }
        let weight = material.dielectric.transmission * (1.0 - r);
        points.refracted.weight[l] = if is_total { 0.0 } else { weight };
    }
}

lane_kernel! {
    fn refracted_rays(
        material: &WhittedMaterial,
        rays: &RayPacket,
        hits: &Intersections,
        points: &mut ShadingPoints,
    ) = refracted_rays_body;
}
