//! Eq. 4.2: what a light adds to the shading points of a packet, and the shadow rays that decide whether it does.

#![expect(
    clippy::needless_range_loop,
    reason = "one index for the lanes of many arrays"
)]

use glam::Vec3;

use super::{ShadingPoints, WhittedLanes};
use crate::math::functions::pow;
use crate::math::{LANES, Lanes3, lane_kernel, splat};
use crate::ray::RayPacket;
use crate::scene::{Falloff, Light, LightKind};

/// A light as lanes see it.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct LightLanes {
    /// Where a point light is; the direction to a directional one.
    at: Vec3,
    is_point: bool,
    has_falloff: bool,
    intensity: Vec3,
    pub(in crate::render) casts_shadow: bool,
}

impl From<&Light> for LightLanes {
    fn from(light: &Light) -> Self {
        let (at, is_point, has_falloff) = match light.kind {
            LightKind::Point { position, falloff } => {
                (position, true, falloff == Falloff::InverseSquare)
            }
            LightKind::Directional { to_light } => (to_light, false, false),
        };
        Self {
            at,
            is_point,
            has_falloff,
            intensity: light.radiance,
            casts_shadow: light.casts_shadow,
        }
    }
}

/// What a light gives to the shading points of a packet.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(in crate::render) struct LightSamples {
    /// Rays to the light; those of lanes that it does not shine on end before they start.
    pub(in crate::render) shadow_rays: RayPacket,
    /// Radiance that the light adds to each sample if nothing is in its way.
    pub(in crate::render) contribution: Lanes3,
    /// Lanes that it shines on.
    pub(in crate::render) lanes: u32,
}

impl Default for LightSamples {
    fn default() -> Self {
        Self {
            shadow_rays: RayPacket::default(),
            contribution: [splat(0.0); 3],
            lanes: 0,
        }
    }
}

/// Blinn and Phong's reflection (eq. 4.2) of one light at the shading points of `lanes`.
#[expect(
    clippy::too_many_arguments,
    reason = "arrays that do not overlap are parameters of their own; see `lane_kernel!`"
)]
#[inline(always)]
fn sample_light_body(
    light: &LightLanes,
    material: &WhittedLanes,
    rays: &RayPacket,
    points: &ShadingPoints,
    base: &Lanes3,
    throughput: &Lanes3,
    lanes: u32,
    samples: &mut LightSamples,
) {
    let mut lit = 0;
    for l in 0..LANES {
        let start = [points.start[0][l], points.start[1][l], points.start[2][l]];
        let n = [
            points.normal[0][l],
            points.normal[1][l],
            points.normal[2][l],
        ];
        // Direction and distance.
        let mut v = [light.at.x, light.at.y, light.at.z];
        let mut distance = f32::INFINITY;
        let mut falloff = 1.0;
        if light.is_point {
            for axis in 0..3 {
                v[axis] -= start[axis];
            }
            distance = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            let inverse = 1.0 / distance;
            for axis in 0..3 {
                v[axis] *= inverse;
            }
            if light.has_falloff {
                falloff = 1.0 / (distance * distance);
            }
        }
        // Not a number at the place of a point light, and then not lit.
        let cosine = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        let is_facing = cosine > 0.0 && lanes >> l & 1 == 1;
        let mut highlight = 0.0;
        if material.specular > 0.0 {
            let h = [
                v[0] - rays.direction[0][l],
                v[1] - rays.direction[1][l],
                v[2] - rays.direction[2][l],
            ];
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
        // What is dark needs no shadow ray.
        let is_lit = is_facing && (material.diffuse > 0.0 || highlight > 0.0);
        lit |= u32::from(is_lit) << l;
        let scattered = material.diffuse * cosine;
        for axis in 0..3 {
            let reflected = scattered * base[axis][l] + highlight;
            let arriving = falloff * light.intensity[axis];
            samples.contribution[axis][l] = throughput[axis][l] * (arriving * reflected);
            samples.shadow_rays.origin[axis][l] = start[axis];
            samples.shadow_rays.direction[axis][l] = v[axis];
        }
        samples.shadow_rays.t_min[l] = 0.0;
        samples.shadow_rays.t_max[l] = if is_lit { distance } else { -1.0 };
    }
    samples.lanes = lit;
}

lane_kernel! {
    pub(in crate::render) fn sample_light(
        light: &LightLanes,
        material: &WhittedLanes,
        rays: &RayPacket,
        points: &ShadingPoints,
        base: &Lanes3,
        throughput: &Lanes3,
        lanes: u32,
        samples: &mut LightSamples,
    ) = sample_light_body;
}
