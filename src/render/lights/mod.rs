//! Lights: each samples the light that arrives at the shading points of a packet.
//!
//! A new kind of light is one file here and a line in [`light_of`].

use crate::scene::{self, LightKind};

mod directional;
mod light;
mod point;

use directional::DirectionalLight;
pub(super) use light::{Light, LightSamples};
use point::PointLight;

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
