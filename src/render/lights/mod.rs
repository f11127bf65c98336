//! Where light comes from: each light says what of it arrives at the shading points of a packet.
//!
//! A new kind of light is one file here and a line in [`light_of`].

use crate::math::{Lanes3, Supported, splat};
use crate::ray::RayPacket;
use crate::scene::{self, LightKind};

mod directional;
mod point;

use directional::DirectionalLight;
use point::PointLight;

/// A light.
pub(super) trait Light: Sync {
    /// Samples the light that arrives at `start`, the shading points of a packet, if nothing is in its way.
    fn sample_li(&self, simd: Supported, start: &Lanes3, samples: &mut LightSamples);

    /// Whether things stand in its way; without, it costs no ray.
    fn casts_shadow(&self) -> bool;
}

/// A sample of a light for each shading point of a packet.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct LightSamples {
    /// Rays to the light.
    pub(super) rays: RayPacket,
    /// Radiance that arrives along each ray; then what of it the surface sends on to the sample of the picture.
    pub(super) radiance: Lanes3,
    /// Lanes that the light shines on.
    pub(super) lanes: u32,
}

impl Default for LightSamples {
    fn default() -> Self {
        Self {
            rays: RayPacket::default(),
            radiance: [splat(0.0); 3],
            lanes: 0,
        }
    }
}

/// The light that a scene's `light` is.
pub(super) fn light_of(light: &scene::Light) -> Box<dyn Light> {
    match light.kind {
        LightKind::Point { position, falloff } => Box::new(PointLight {
            position,
            falloff,
            intensity: light.radiance,
            casts_shadow: light.casts_shadow,
        }),
        LightKind::Directional { to_light } => Box::new(DirectionalLight {
            to_light,
            radiance: light.radiance,
            casts_shadow: light.casts_shadow,
        }),
    }
}
