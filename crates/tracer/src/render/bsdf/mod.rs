//! Reflection at opaque surfaces, for path tracing: bidirectional scattering distribution functions (BSDFs) for the 16
//! lanes of a packet.
//!
//! To add one, add a file here with a type that is a [`point::SampledBsdf`] for one ray, or a [`point::LocalBsdf`] in the
//! frame of the surface, and a line in [`bsdf_of`]. Add it also to `finish_tests.rs`. See
//! `docs/manual/adding-a-material.md`.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use crate::render::lights::LightSamples;
use crate::scene::Finish;
use spherule_surface::Intersections;
use spherule_tree::math::{LANES, Lanes, Lanes3, Supported, lane_kernel};
use spherule_tree::ray::RayPacket;

mod blinn_phong;
#[cfg(test)]
mod finish_tests;
mod foam;
mod matte;
mod metal;
pub(super) mod microfacet;
mod plastic;
mod point;
#[cfg(test)]
mod tests;

pub(super) use blinn_phong::BlinnPhong;
use foam::Foam;
use matte::Matte;
use metal::Metal;
use microfacet::Ggx;
use plastic::Plastic;
pub(super) use point::eval_lanes;

/// Points on opaque surfaces.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(super) struct SurfacePoints {
    /// Unit shading normal, on the side of the ray.
    pub(super) normal: Lanes3,
    /// Unit geometric normal, on the side of the ray.
    pub(super) geometric: Lanes3,
    /// Origins of the rays that leave.
    pub(super) start: Lanes3,
    /// Base colour, 0 to 1 in each component.
    pub(super) albedo: Lanes3,
}

/// Values of a BSDF for two given directions.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(super) struct BsdfValues {
    /// The BSDF times the cosine of the outgoing direction with the normal, linear RGB, per steradian.
    pub(super) value: Lanes3,
    /// Probability density with which the BSDF samples the direction, per steradian.
    pub(super) pdf: Lanes,
}

/// Directions sampled from a BSDF.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub(super) struct BsdfSamples {
    pub(super) direction: Lanes3,
    /// The BSDF times the cosine over the density, linear RGB.
    pub(super) weight: Lanes3,
    /// Probability density, per steradian; 0 for lanes without a direction.
    pub(super) pdf: Lanes,
}

/// Reflection at an opaque surface. Directions below the geometric surface have no weight, except for foam.
pub(super) trait Bsdf: Sync {
    /// Stores the values for light from unit `direction` that leaves against `rays`, only for `lanes`.
    fn eval(
        &self,
        simd: Supported,
        rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        values: &mut BsdfValues,
    );

    /// Samples directions from which light arrives that leaves against `rays`, only for `lanes`. The numbers `u` are
    /// in 0..1.
    fn sample(
        &self,
        simd: Supported,
        rays: &RayPacket,
        points: &SurfacePoints,
        u: &[Lanes; 2],
        lanes: u32,
        samples: &mut BsdfSamples,
    );

    /// Stores the diffuse part of the reflection of light from unit `direction` that leaves against `rays`, 0 to 1,
    /// only for `lanes`.
    fn diffuse_part(
        &self,
        rays: &RayPacket,
        points: &SurfacePoints,
        direction: &Lanes3,
        lanes: u32,
        part: &mut Lanes3,
    );
}

/// The BSDF of opaque surfaces with this finish. Panes are none, and their BSDF is not used.
pub(super) fn bsdf_of(finish: Finish) -> Box<dyn Bsdf> {
    match finish {
        Finish::Matte | Finish::Pane => Box::new(Matte),
        Finish::Plastic { roughness } => Box::new(Plastic::new(roughness)),
        Finish::Metal { roughness } => Box::new(Metal::new(roughness)),
        Finish::Foam => Box::new(Foam),
    }
}

/// Width of the microfacets of a rough `finish`, and the fractions of light that leave it for cosines from 0 to 1, evenly
/// spaced, with their mean.
pub fn rough_table(finish: Finish) -> Option<(f32, Vec<f32>)> {
    let (roughness, table) = match finish {
        Finish::Matte | Finish::Pane | Finish::Foam => return None,
        Finish::Plastic { roughness } => {
            (roughness, Plastic::new(roughness).leaving().table().collect())
        }
        Finish::Metal { roughness } => {
            (roughness, Metal::new(roughness).leaving().table().collect())
        }
    };
    Some((Ggx::new(roughness).width(), table))
}

/// Computes the points of intersections on opaque surfaces, with normals on the side of the rays.
#[inline(always)]
fn surface_points_body(
    rays: &RayPacket,
    hits: &Intersections,
    base: &Lanes3,
    points: &mut SurfacePoints,
) {
    for l in 0..LANES {
        // Find the side of the ray, for both normals
        let mut along = [0.0; 2];
        for axis in 0..3 {
            let d = rays.direction[axis][l];
            along[0] += d * hits.normal[axis][l];
            along[1] += d * hits.shading_normal[axis][l];
        }
        let side = if along[0] < 0.0 { 1.0 } else { -1.0 };
        let shading_side = if along[1] < 0.0 { 1.0 } else { -1.0 };
        // Start scattered rays above the surface on this side
        for axis in 0..3 {
            let geometric = side * hits.normal[axis][l];
            let normal = shading_side * hits.shading_normal[axis][l];
            let start = hits.anchor[axis][l] + hits.offset[l] * geometric;
            points.normal[axis][l] = normal;
            points.geometric[axis][l] = geometric;
            points.start[axis][l] = start + hits.lift[l] * normal;
            // A surface reflects no more light than arrives; NaN reflects none
            let albedo = base[axis][l];
            let albedo = if albedo > 0.0 { albedo } else { 0.0 };
            points.albedo[axis][l] = if albedo < 1.0 { albedo } else { 1.0 };
        }
    }
}

lane_kernel! {
    pub(super) fn surface_points(
        rays: &RayPacket,
        hits: &Intersections,
        base: &Lanes3,
        points: &mut SurfacePoints,
    ) = surface_points_body;
}

/// Converts the radiance of light samples to the radiance that leaves the surface, times `throughput`, only for
/// `lanes`. `competes`: the BSDF samples the same light, so that the balance heuristic weights both (Veach, "Robust
/// Monte Carlo Methods for Light Transport Simulation", 1997). Shadow rays of dark lanes end before they start.
#[inline(always)]
fn reflect_samples_body(
    values: &BsdfValues,
    throughput: &Lanes3,
    competes: bool,
    lanes: u32,
    samples: &mut LightSamples,
) {
    let mut lit_lanes = 0;
    for l in 0..LANES {
        // A light without extent has an infinite density, and its radiance is that of the whole light
        let pdf = samples.pdf[l];
        let other = if competes { values.pdf[l] } else { 0.0 };
        let factor = if pdf < f32::INFINITY { 1.0 / (pdf + other) } else { 1.0 };
        let mut brightest = 0.0;
        for axis in 0..3 {
            let reflected = values.value[axis][l] * (samples.radiance[axis][l] * factor);
            let reflected = throughput[axis][l] * reflected;
            samples.radiance[axis][l] = reflected;
            brightest = if reflected > brightest { reflected } else { brightest };
        }
        let is_lit = brightest > 0.0 && lanes >> l & 1 == 1;
        lit_lanes |= u32::from(is_lit) << l;
        samples.rays.t_max[l] = if is_lit { samples.rays.t_max[l] } else { -1.0 };
    }
    samples.lanes = lit_lanes;
}

lane_kernel! {
    pub(super) fn reflect_samples(
        values: &BsdfValues,
        throughput: &Lanes3,
        competes: bool,
        lanes: u32,
        samples: &mut LightSamples,
    ) = reflect_samples_body;
}
