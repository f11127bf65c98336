//! The surface of one connected transmissive body. It is lit from outside alone; from inside it only reflects and
//! refracts.

use super::material::Material;
use super::points::ShadingPoints;
use super::whitted::WhittedMaterial;
use crate::math::{LANES, Supported, lane_kernel};
use crate::ray::RayPacket;
use crate::surface::Intersections;

/// Least cosine between a ray and a normal: interpolated normals may turn away from rays that graze.
const GRAZING: f32 = 1e-3;

/// See the module.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interface(pub(super) WhittedMaterial);

impl Material for Interface {
    fn constants(&self) -> &WhittedMaterial {
        &self.0
    }

    fn shading_points(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        points: &mut ShadingPoints,
    ) {
        interface_points(simd, &self.0, rays, hits, inside, points);
    }

    fn lit_lanes(&self, lanes: u32, inside: u32) -> u32 {
        lanes & !inside
    }
}

/// The shading points of the surface of one connected body, and both rays that leave them; the rays in `inside` come
/// from within. Light is bent by the normal to shade by, and goes on from off the surface that rays meet.
#[inline(always)]
fn interface_points_body(
    material: &WhittedMaterial,
    rays: &RayPacket,
    hits: &Intersections,
    inside: u32,
    points: &mut ShadingPoints,
) {
    for l in 0..LANES {
        let is_inside = inside >> l & 1 == 1;
        let side = if is_inside { -1.0 } else { 1.0 };
        let mut d = [0.0; 3];
        let mut s = [0.0; 3];
        for axis in 0..3 {
            d[axis] = rays.direction[axis][l];
            s[axis] = hits.shading_normal[axis][l] * side;
        }
        // The normal, turned against the ray as little as it takes.
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
            let turned = if has_length {
                turned[axis] * inverse
            } else {
                -d[axis]
            };
            n[axis] = if is_facing { s[axis] } else { turned };
        }
        // Both rays.
        let cosine = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2]);
        let ratio = if is_inside {
            material.dielectric.ior
        } else {
            1.0 / material.dielectric.ior
        };
        let (r, sin2_out) = material.dielectric.fresnel(cosine, ratio);
        let rest = 1.0 - sin2_out;
        let along_normal = ratio * cosine - (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let mut onward = [0.0; 3];
        let mut back = [0.0; 3];
        for axis in 0..3 {
            onward[axis] = ratio * d[axis] + along_normal * n[axis];
            back[axis] = d[axis] + 2.0 * cosine * n[axis];
        }
        let onward2 = onward[0] * onward[0] + onward[1] * onward[1] + onward[2] * onward[2];
        let back2 = back[0] * back[0] + back[1] * back[1] + back[2] * back[2];
        let inverse_onward = 1.0 / onward2.sqrt();
        let inverse_back = 1.0 / back2.sqrt();
        let has_onward = inverse_onward > 0.0 && inverse_onward < f32::INFINITY;
        for axis in 0..3 {
            let step = hits.offset[l] * (hits.normal[axis][l] * side);
            let onward = onward[axis] * inverse_onward;
            points.normal[axis][l] = n[axis];
            points.start[axis][l] = hits.anchor[axis][l] + step;
            points.reflected.origin[axis][l] = hits.anchor[axis][l] + step;
            points.reflected.direction[axis][l] = back[axis] * inverse_back;
            points.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            points.refracted.direction[axis][l] = if has_onward { onward } else { d[axis] };
        }
        points.reflected.weight[l] = material.reflection * r;
        points.refracted.weight[l] = material.dielectric.transmission * (1.0 - r);
    }
}

lane_kernel! {
    fn interface_points(
        material: &WhittedMaterial,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        points: &mut ShadingPoints,
    ) = interface_points_body;
}
