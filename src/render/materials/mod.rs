//! What surfaces do with light.
//!
//! A new material is one file here and a line in [`materials_of`].

use crate::math::{Lanes3, Supported, splat};
use crate::ray::RayPacket;
use crate::scene::{Scene, ground};
use crate::surface::{Intersections, MaterialId};

use super::lights::LightSamples;
use super::stream::ScatteredRays;

mod blinn_phong;
mod interface;
mod medium;
mod whitted;

use blinn_phong::reflect_lights;
use interface::Interface;
pub(super) use medium::{attenuate, leaving, passed_straight};
pub(super) use whitted::WhittedMaterial;

/// Highlights of clear bodies below this part of the light are dark.
const DARKEST_HIGHLIGHT: f32 = 1.0 / 4096.0;

/// A material as equation 4.1 of the thesis knows it: what it does with the light of lights, and with what weights
/// further rays leave it.
pub(super) trait Material: Sync {
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

/// Where the rays of a packet meet surfaces, as light and further rays see it.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct ShadingPoints {
    /// Unit normal to shade by, on the side that the ray comes from.
    pub(super) normal: Lanes3,
    /// Where rays to lights start.
    pub(super) start: Lanes3,
    /// Reflected rays.
    pub(super) reflected: ScatteredRays,
    /// Refracted rays, of transmissive materials alone.
    pub(super) refracted: ScatteredRays,
}

impl Default for ShadingPoints {
    fn default() -> Self {
        let zero = [splat(0.0); 3];
        Self {
            normal: zero,
            start: zero,
            reflected: ScatteredRays::default(),
            refracted: ScatteredRays::default(),
        }
    }
}

/// The materials of `scene` by [`MaterialId`]. `is_connected` says that the particles bound one body.
pub(super) fn materials_of(
    scene: &Scene,
    is_connected: bool,
) -> [Box<dyn Material>; MaterialId::COUNT] {
    let ambient = scene.ambient_light;
    let matte = || WhittedMaterial::matte(ground::AMBIENT, ground::DIFFUSE, ambient);
    let mut constants = WhittedMaterial::new(&scene.material, ambient);
    let particles: Box<dyn Material> = if is_connected && constants.transmission > 0.0 {
        if !constants.has_color() {
            constants.darkest_highlight = DARKEST_HIGHLIGHT;
        }
        Box::new(Interface(constants))
    } else {
        Box::new(constants)
    };
    [particles, Box::new(matte()), Box::new(matte())]
}
