//! Eq. 4.2: reflection of direct light by the model of Blinn and Phong.

use super::points::ShadingPoints;
use super::whitted::WhittedMaterial;
use crate::render::lights::LightSamples;
use spherule_tree::math::functions::pow;
use spherule_tree::math::{LANES, Lanes3, lane_kernel};
use spherule_tree::ray::RayPacket;

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
    let mut lit_lanes = 0;
    for l in 0..LANES {
        // Compute the half vector
        let mut v = [0.0; 3];
        let mut n = [0.0; 3];
        let mut h = [0.0; 3];
        for axis in 0..3 {
            v[axis] = samples.rays.direction[axis][l];
            n[axis] = points.normal[axis][l];
            h[axis] = v[axis] - rays.direction[axis][l];
        }
        // The cosine is NaN at the exact position of a point light, which is then not facing.
        let cosine = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let is_facing = cosine > 0.0 && lanes >> l & 1 == 1;
        // Evaluate the highlight
        let mut highlight = 0.0;
        if material.specular > 0.0 {
            let inverse = 1.0 / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let along = n[0] * (h[0] * inverse) + n[1] * (h[1] * inverse) + n[2] * (h[2] * inverse);
            // Without a half vector (a light straight behind the surface), use the normal.
            let along = if inverse < f32::INFINITY { along } else { 1.0 };
            let along = if along > 0.0 { along } else { 0.0 };
            let along = if along < 1.0 { along } else { 1.0 };
            let highlight_power = pow(along, material.shininess);
            highlight = if highlight_power > material.min_highlight {
                material.specular * highlight_power
            } else {
                0.0
            };
        }
        // Lanes without reflected light need no shadow ray
        let is_lit = is_facing && (material.diffuse > 0.0 || highlight > 0.0);
        lit_lanes |= u32::from(is_lit) << l;
        // Multiply the light by the reflectance and the throughput
        let scattered = material.diffuse * cosine;
        for axis in 0..3 {
            let reflected = scattered * base[axis][l] + highlight;
            let arriving = samples.radiance[axis][l];
            samples.radiance[axis][l] = throughput[axis][l] * (arriving * reflected);
        }
        samples.rays.t_max[l] = if is_lit { samples.rays.t_max[l] } else { -1.0 };
    }
    samples.lanes = lit_lanes;
}

lane_kernel! {
    /// Converts the radiance that arrives from a light to the radiance reflected along `rays`, times `throughput`.
    /// Shadow rays of lanes that are not lit end before they start.
    pub(in crate::render) fn reflect_lights(
        material: &WhittedMaterial,
        rays: &RayPacket,
        points: &ShadingPoints,
        base: &Lanes3,
        throughput: &Lanes3,
        lanes: u32,
        samples: &mut LightSamples,
    ) = reflect_lights_body;
}
