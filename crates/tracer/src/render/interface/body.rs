//! The surface of one connected transmissive body. Light sources illuminate it only from outside; from inside it only
//! reflects and refracts.

use super::{Dielectric, Interface, LeavingRays};
use crate::render::bsdf::SurfacePoints;
use spherule_surface::Intersections;
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

/// Minimum cosine between a ray and a normal: interpolated normals may face away from grazing rays.
const GRAZING: f32 = 1e-3;

/// The interface of a connected transmissive body, see the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyInterface(pub(super) Dielectric);

impl Interface for BodyInterface {
    fn dielectric(&self) -> &Dielectric {
        &self.0
    }

    fn leave(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        _u: &[Lanes; 2],
        points: &mut SurfacePoints,
        leaving: &mut LeavingRays,
    ) {
        let SurfacePoints { normal, start, .. } = points;
        body_rays(simd, &self.0, rays, hits, inside, normal, start, leaving);
    }
}

/// The rays that leave the surface of one connected body, with shading normals that face the arriving rays and origins
/// of shadow rays; rays of `inside` come from inside. The shading normal determines their directions; their origins are offset from the surface that rays
/// are traced against.
#[inline(always)]
fn body_rays_body(
    dielectric: &Dielectric,
    rays: &RayPacket,
    hits: &Intersections,
    inside: u32,
    normal: &mut Lanes3,
    start: &mut Lanes3,
    leaving: &mut LeavingRays,
) {
    for l in 0..LANES {
        // Orient the shading normal to the side of the ray
        let is_inside = inside >> l & 1 == 1;
        let side = if is_inside { -1.0 } else { 1.0 };
        let mut d = [0.0; 3];
        let mut s = [0.0; 3];
        for axis in 0..3 {
            d[axis] = rays.direction[axis][l];
            s[axis] = hits.shading_normal[axis][l] * side;
        }
        // If it faces away from the ray, turn it by the smallest angle towards the ray
        let along = d[0] * s[0] + d[1] * s[1] + d[2] * s[2];
        let is_facing = along <= -GRAZING;
        let mut turned = [0.0; 3];
        for axis in 0..3 {
            turned[axis] = s[axis] - (along + GRAZING) * d[axis];
        }
        let length2 = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2];
        let inverse = 1.0 / length2.sqrt();
        let has_length = inverse > 0.0 && inverse < f32::INFINITY;
        let mut n = [0.0; 3];
        for axis in 0..3 {
            let turned = if has_length { turned[axis] * inverse } else { -d[axis] };
            n[axis] = if is_facing { s[axis] } else { turned };
        }
        // Compute the Fresnel reflectance, and the directions of both rays
        let cosine = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2]);
        let ratio = if is_inside { dielectric.ior } else { 1.0 / dielectric.ior };
        let (r, sin2_out) = dielectric.fresnel(cosine, ratio);
        let rest = 1.0 - sin2_out;
        let along_normal = ratio * cosine - (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let mut refracted = [0.0; 3];
        let mut reflected = [0.0; 3];
        for axis in 0..3 {
            refracted[axis] = ratio * d[axis] + along_normal * n[axis];
            reflected[axis] = d[axis] + 2.0 * cosine * n[axis];
        }
        // Normalise the directions
        let refracted2 =
            refracted[0] * refracted[0] + refracted[1] * refracted[1] + refracted[2] * refracted[2];
        let reflected2 =
            reflected[0] * reflected[0] + reflected[1] * reflected[1] + reflected[2] * reflected[2];
        let inverse_refracted = 1.0 / refracted2.sqrt();
        let inverse_reflected = 1.0 / reflected2.sqrt();
        let has_refracted = inverse_refracted > 0.0 && inverse_refracted < f32::INFINITY;
        for axis in 0..3 {
            let step = hits.offset[l] * (hits.normal[axis][l] * side);
            let refracted = refracted[axis] * inverse_refracted;
            normal[axis][l] = n[axis];
            start[axis][l] = hits.anchor[axis][l] + step;
            leaving.reflected.origin[axis][l] = hits.anchor[axis][l] + step;
            leaving.reflected.direction[axis][l] = reflected[axis] * inverse_reflected;
            leaving.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            leaving.refracted.direction[axis][l] = if has_refracted { refracted } else { d[axis] };
        }
        // Weight the rays
        leaving.reflected.weight[l] = dielectric.reflection * r;
        leaving.refracted.weight[l] = dielectric.transmission * (1.0 - r);
    }
}

lane_kernel! {
    fn body_rays(
        dielectric: &Dielectric,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        normal: &mut Lanes3,
    start: &mut Lanes3,
    leaving: &mut LeavingRays,
    ) = body_rays_body;
}
