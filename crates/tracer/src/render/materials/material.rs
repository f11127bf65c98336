//! The interface between materials and the Whitted integrator.

use super::blinn_phong::reflect_lights;
use super::points::ShadingPoints;
use super::whitted::WhittedMaterial;
use crate::render::lights::LightSamples;
use crate::surface::Intersections;
use spherule_tree::math::{Lanes3, Supported};
use spherule_tree::ray::RayPacket;

/// A material as defined by equation 4.1 of the thesis: its reflection of direct light, and the weights of the rays
/// that leave it.
pub(in crate::render) trait Material: Sync {
    /// The constants of equations 4.1 to 4.3.
    fn constants(&self) -> &WhittedMaterial;

    /// Computes shading points and the rays that leave them from intersections; rays of `inside` come from inside a
    /// connected body.
    fn shading_points(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        points: &mut ShadingPoints,
    );

    /// The `lanes` with direct light.
    fn lit_lanes(&self, lanes: u32, inside: u32) -> u32 {
        let _ = inside;
        lanes
    }

    /// Converts the radiance that arrives from a light to the radiance reflected along the rays of the packet, times
    /// `throughput`, only for `lanes`; all other lanes are not lit.
    #[expect(clippy::too_many_arguments, reason = "arrays that do not overlap; see `lane_kernel!`")]
    fn reflect(
        &self,
        simd: Supported,
        rays: &RayPacket,
        points: &ShadingPoints,
        base: &Lanes3,
        throughput: &Lanes3,
        lanes: u32,
        samples: &mut LightSamples,
    ) {
        let constants = self.constants();
        reflect_lights(simd, constants, rays, points, base, throughput, lanes, samples);
    }
}
