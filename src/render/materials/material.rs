//! The interface between materials and the Whitted integrator.

use super::blinn_phong::reflect_lights;
use super::points::ShadingPoints;
use super::whitted::WhittedMaterial;
use crate::math::{Lanes3, Supported};
use crate::ray::RayPacket;
use crate::render::lights::LightSamples;
use crate::surface::Intersections;

/// A material as equation 4.1 of the thesis knows it: what it does with the light of lights, and with what weights
/// further rays leave it.
pub(in crate::render) trait Material: Sync {
    /// The constants of equations 4.1 to 4.3.
    fn constants(&self) -> &WhittedMaterial;

    /// From intersections to shading points with the rays that leave them; rays in `inside` come from within a connected
    /// body.
    fn shading_points(
        &self,
        simd: Supported,
        rays: &RayPacket,
        hits: &Intersections,
        inside: u32,
        points: &mut ShadingPoints,
    );

    /// The `lanes` at which lights are seen.
    fn lit_lanes(&self, lanes: u32, inside: u32) -> u32 {
        let _ = inside;
        lanes
    }

    /// Makes of the radiance that arrives from a light what goes on along the rays of the packet, times `throughput`, for
    /// `lanes` alone; the others are not lit.
    #[expect(
        clippy::too_many_arguments,
        reason = "arrays that do not overlap; see `lane_kernel!`"
    )]
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
        reflect_lights(
            simd, constants, rays, points, base, throughput, lanes, samples,
        );
    }
}
