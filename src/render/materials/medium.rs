//! What becomes of light on its way through transmissive bodies.

use glam::Vec3;

use super::WhittedMaterial;
use crate::math::functions::exp;
use crate::math::{LANES, Lanes, Lanes3, lane_kernel};
use crate::ray::RayPacket;
use crate::surface::Intersections;

/// Takes from `throughput` what a medium takes on a way of `length` (the law of Beer and Lambert), for `lanes` alone.
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
    material: &WhittedMaterial,
    rays: &RayPacket,
    hits: &Intersections,
    lanes: u32,
    kept: &mut Lanes3,
) {
    let (d, n) = (&rays.direction, &hits.normal);
    for l in 0..LANES {
        let along = d[0][l] * n[0][l] + d[1][l] * n[1][l] + d[2][l] * n[2][l];
        let passed = material.passed_straight(along.abs());
        let passed = if lanes >> l & 1 == 1 { passed } else { 1.0 };
        for kept in &mut *kept {
            kept[l] *= passed;
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn passed_straight(
        material: &WhittedMaterial,
        rays: &RayPacket,
        hits: &Intersections,
        lanes: u32,
        kept: &mut Lanes3,
    ) = passed_straight_body;
}
