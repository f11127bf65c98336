//! Lights: each samples the light that arrives at the shading points of a packet.
//!
//! To add a kind of light, add a file here and a line in [`light_of`].

use crate::scene::{self, LightKind};

mod directional;
mod environment;
mod light;
mod point;

use directional::DirectionalLight;
pub(super) use environment::{environment_along, sample_environment};
pub(super) use light::{Light, LightSamples};
use point::PointLight;

/// The light for a `light` of the scene.
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
