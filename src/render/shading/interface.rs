//! Transmissive surfaces: refracted rays by Snell's law, and what a medium takes of light on the way through it
//! (the law of Beer and Lambert).

#![expect(
    clippy::needless_range_loop,
    reason = "one index for the lanes of many arrays"
)]

use glam::Vec3;

use super::{ShadingPoints, WhittedLanes};
use crate::math::functions::exp;
use crate::math::{LANES, Lanes, Lanes3, lane_kernel};
use crate::ray::RayPacket;
use crate::surface::Intersections;

/// Least cosine between a ray and a normal: interpolated normals may turn away from rays that graze.
const GRAZING: f32 = 1e-3;

/// The refracted rays at the shading points of spheres that are bodies of their own.
#[inline(always)]
fn refracted_rays_body(
    material: &WhittedLanes,
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
        let is_entering = along < 0.0;
        let side = if is_entering { 1.0 } else { -1.0 };
        let cosine = if is_entering { -along } else { along };
        let ratio = if is_entering {
            1.0 / material.ior
        } else {
            material.ior
        };
        let (r, sin2_out) = material.fresnel(cosine, ratio);
        let is_total = sin2_out >= 1.0;
        let along_normal = ratio * cosine - (1.0 - if is_total { 1.0 } else { sin2_out }).sqrt();
        let mut onward = [0.0; 3];
        for axis in 0..3 {
            onward[axis] = ratio * d[axis] + along_normal * (n[axis] * side);
        }
        // Normalised so that errors do not add up over a path.
        let length2 = onward[0] * onward[0] + onward[1] * onward[1] + onward[2] * onward[2];
        let inverse = 1.0 / length2.sqrt();
        for axis in 0..3 {
            let step = hits.offset[l] * (n[axis] * side);
            points.refracted.origin[axis][l] = hits.anchor[axis][l] - step;
            points.refracted.direction[axis][l] = onward[axis] * inverse;
        }
        let weight = material.transmission * (1.0 - r);
        points.refracted.weight[l] = if is_total { 0.0 } else { weight };
    }
}

lane_kernel! {
    pub(in crate::render) fn refracted_rays(
        material: &WhittedLanes,
        rays: &RayPacket,
        hits: &Intersections,
        points: &mut ShadingPoints,
    ) = refracted_rays_body;
}

/// The shading points of the surface of one connected body, and both rays that leave them; the rays in `inside` come
/// from within. Light is bent by the normal to shade by, and goes on from off the surface that rays meet.
#[inline(always)]
fn interface_points_body(
    material: &WhittedLanes,
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
            material.ior
        } else {
            1.0 / material.ior
        };
        let (r, sin2_out) = material.fresnel(cosine, ratio);
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
        points.refracted.weight[l] = material.transmission * (1.0 - r);
    }
}

lane_kernel! {
    pub(in crate::render) fn interface_points(
        material: &WhittedLanes,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        points: &mut ShadingPoints,
    ) = interface_points_body;
}

/// Takes from `throughput` what a medium takes on a way of `length`, for `lanes` alone.
#[inline(always)]
fn attenuate_body(extinction: &Vec3, length: &Lanes, lanes: u32, throughput: &mut Lanes3) {
    for axis in 0..3 {
        for l in 0..LANES {
            let length = if length[l] > 0.0 { length[l] } else { 0.0 };
            let kept = throughput[axis][l] * exp(-length * extinction[axis]);
            let is_inside = lanes >> l & 1 == 1;
            throughput[axis][l] = if is_inside { kept } else { throughput[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn attenuate(
        extinction: &Vec3,
        length: &Lanes,
        lanes: u32,
        throughput: &mut Lanes3,
    ) = attenuate_body;
}

/// The lanes whose rays leave a sphere where they meet it.
#[inline(always)]
fn leaving_body(rays: &RayPacket, hits: &Intersections) -> u32 {
    let (d, n) = (&rays.direction, &hits.normal);
    let mut leaving = 0;
    for l in 0..LANES {
        let along = d[0][l] * n[0][l] + d[1][l] * n[1][l] + d[2][l] * n[2][l];
        leaving |= u32::from(along >= 0.0) << l;
    }
    leaving
}

lane_kernel! {
    pub(in crate::render) fn leaving(rays: &RayPacket, hits: &Intersections) -> u32 = leaving_body;
}

/// What rays to a light keep where they go straight through a surface.
#[inline(always)]
fn passed_straight_body(
    material: &WhittedLanes,
    rays: &RayPacket,
    hits: &Intersections,
    lanes: u32,
    kept: &mut Lanes3,
) {
    let (d, n) = (&rays.direction, &hits.normal);
    for l in 0..LANES {
        let along = d[0][l] * n[0][l] + d[1][l] * n[1][l] + d[2][l] * n[2][l];
        let passed = material.passed_straight(along.abs());
        for axis in 0..3 {
            let is_met = lanes >> l & 1 == 1;
            let less = kept[axis][l] * passed;
            kept[axis][l] = if is_met { less } else { kept[axis][l] };
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn passed_straight(
        material: &WhittedLanes,
        rays: &RayPacket,
        hits: &Intersections,
        lanes: u32,
        kept: &mut Lanes3,
    ) = passed_straight_body;
}
