//! The environment for packets of rays.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::light::LightSamples;
use crate::scene::Environment;
use glam::Vec3;
use spherule_tree::math::{LANES, Lanes, Lanes3, lane_kernel, set_lane3};

/// Samples a direction towards the environment for each lane. The numbers `u` are in 0..1.
#[inline(always)]
fn sample_environment_body(
    environment: &Environment,
    start: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut LightSamples,
) {
    for l in 0..LANES {
        let sample = environment.sample([u[0][l], u[1][l]]);
        set_lane3(&mut samples.rays.direction, l, sample.direction);
        set_lane3(&mut samples.radiance, l, sample.radiance);
        samples.pdf[l] = sample.pdf;
        samples.rays.t_min[l] = 0.0;
        samples.rays.t_max[l] = f32::INFINITY;
    }
    samples.rays.origin = *start;
}

lane_kernel! {
    pub(in crate::render) fn sample_environment(
        environment: &Environment,
        start: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) = sample_environment_body;
}

/// Samples a direction towards the environment for each lane, without its radiance. The numbers `u` are in 0..1.
#[inline(always)]
fn sample_directions_body(environment: &Environment, u: &[Lanes; 2], directions: &mut Lanes3) {
    for l in 0..LANES {
        set_lane3(directions, l, environment.sample_direction([u[0][l], u[1][l]]));
    }
}

lane_kernel! {
    pub(in crate::render) fn sample_directions(
        environment: &Environment,
        u: &[Lanes; 2],
        directions: &mut Lanes3,
    ) = sample_directions_body;
}

/// Radiance of the environment along `direction` times `throughput`. `pdf` is the density with which each direction
/// was sampled elsewhere: the balance heuristic weights it against the sampling of the environment. An infinite
/// density has the full weight.
#[inline(always)]
fn environment_along_body(
    environment: &Environment,
    direction: &Lanes3,
    pdf: &Lanes,
    throughput: &Lanes3,
    radiance: &mut Lanes3,
) {
    for l in 0..LANES {
        let along = Vec3::new(direction[0][l], direction[1][l], direction[2][l]);
        let (arriving, other) = environment.radiance_and_pdf(along);
        let weight = if pdf[l] < f32::INFINITY { pdf[l] / (pdf[l] + other) } else { 1.0 };
        for axis in 0..3 {
            radiance[axis][l] = throughput[axis][l] * (weight * arriving[axis]);
        }
    }
}

lane_kernel! {
    pub(in crate::render) fn environment_along(
        environment: &Environment,
        direction: &Lanes3,
        pdf: &Lanes,
        throughput: &Lanes3,
        radiance: &mut Lanes3,
    ) = environment_along_body;
}
