//! Eq. 4.2: what surfaces send on of the light of a light, by Blinn and Phong.

use super::points::ShadingPoints;
use super::whitted::WhittedMaterial;
use crate::math::functions::pow;
use crate::math::{LANES, Lanes3, lane_kernel};
use crate::ray::RayPacket;
use crate::render::lights::LightSamples;

#[inline(always)]
fn reflect_lights_body(
    material: &WhittedMaterial,
    rays: &RayPacket,
    points: &ShadingPoints,
    base: &Lanes3,
    throughput: &Lanes3,
    lanes: u32,
    samples: &mut LightSamples,
) {
    let mut lit = 0;
    for l in 0..LANES {
        let mut v = [0.0; 3];
        let mut n = [0.0; 3];
        let mut h = [0.0; 3];
        for axis in 0..3 {
            v[axis] = samples.rays.direction[axis][l];
            n[axis] = points.normal[axis][l];
            h[axis] = v[axis] - rays.direction[axis][l];
        }
        // No number at the place of a point light, and then not lit.
        let cosine = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let is_facing = cosine > 0.0 && lanes >> l & 1 == 1;
        let mut highlight = 0.0;
        if material.specular > 0.0 {
            let inverse = 1.0 / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let along = n[0] * (h[0] * inverse) + n[1] * (h[1] * inverse) + n[2] * (h[2] * inverse);
            // A light straight behind the surface has no half vector: the normal serves.
            let along = if inverse < f32::INFINITY { along } else { 1.0 };
            let along = if along > 0.0 { along } else { 0.0 };
            let along = if along < 1.0 { along } else { 1.0 };
            let part = pow(along, material.shininess);
            highlight = if part > material.darkest_highlight {
                material.specular * part
            } else {
                0.0
            };
        }
        // What is dark needs no ray.
        let is_lit = is_facing && (material.diffuse > 0.0 || highlight > 0.0);
        lit |= u32::from(is_lit) << l;
        let scattered = material.diffuse * cosine;
        for axis in 0..3 {
            let reflected = scattered * base[axis][l] + highlight;
            let arriving = samples.radiance[axis][l];
            samples.radiance[axis][l] = throughput[axis][l] * (arriving * reflected);
        }
        samples.rays.t_max[l] = if is_lit { samples.rays.t_max[l] } else { -1.0 };
    }
    samples.lanes = lit;
}

lane_kernel! {
    /// Makes of the radiance that arrives from a light what goes on along `rays`, times `throughput`. Rays to the light of
    /// lanes that are not lit end before they start.
    pub(super) fn reflect_lights(
        material: &WhittedMaterial,
        rays: &RayPacket,
        points: &ShadingPoints,
        base: &Lanes3,
        throughput: &Lanes3,
        lanes: u32,
        samples: &mut LightSamples,
    ) = reflect_lights_body;
}
