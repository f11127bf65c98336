//! Lights: each samples the light that arrives at the shading points of a packet.
//!
//! To add a kind of light, add a file here with a type that is a [`lanes::SampledLight`] for one point (and a
//! [`lanes::LightExtent`] if rays can hit it), and a line in [`light_of`].

use glam::Vec3;

use super::shading::tangents;
use crate::scene::{self, LightKind};

mod directional;
mod environment;
mod lanes;
mod light;
mod panel;
mod point;
mod sphere;
mod sun;
#[cfg(test)]
mod tests;

use directional::DirectionalLight;
pub(super) use environment::{environment_along, sample_directions, sample_environment};
pub(super) use light::{Beam, Emission, Light, LightSamples, PhotonSource};
use panel::{Outline, PanelLight};
use point::PointLight;
use sphere::SphereLight;
use sun::SunLight;

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
            irradiance: light.radiance,
            casts_shadow: light.casts_shadow,
        }),
        LightKind::Sun { to_light, half_angle } => {
            Box::new(SunLight::new(to_light, half_angle, light.radiance, light.is_visible))
        }
        LightKind::Sphere { center, radius } => Box::new(SphereLight {
            center,
            radius,
            radiance: light.radiance,
            is_visible: light.is_visible,
        }),
        LightKind::Rectangle { center, axes, half } => Box::new(PanelLight {
            outline: Outline::Rectangle,
            center,
            axes,
            half,
            radiance: light.radiance,
            is_visible: light.is_visible,
        }),
        LightKind::Disc { center, normal, radius } => Box::new(PanelLight {
            outline: Outline::Ellipse,
            center,
            axes: disc_axes(normal),
            half: [radius; 2],
            radiance: light.radiance,
            is_visible: light.is_visible,
        }),
    }
}

/// What a light with an extent is sampled by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Panels: unit vectors along their width and height, and in the direction that they shine.
    pub axes: [Vec3; 3],
    /// Panels: half their width and height. Spheres: the radius. Suns: 1 minus the cosine of half the apparent diameter.
    pub half: [f32; 2],
    /// Linear RGB.
    pub radiance: Vec3,
}

/// The extent of a `light`, if it has one.
pub fn extent_of(light: &scene::Light) -> Option<Extent> {
    let radiance = light.radiance;
    let round = |size, radiance| Extent { axes: [Vec3::ZERO; 3], half: [size; 2], radiance };
    Some(match light.kind {
        LightKind::Point { .. } | LightKind::Directional { .. } => return None,
        LightKind::Sun { to_light, half_angle } => {
            let sun = SunLight::new(to_light, half_angle, radiance, light.is_visible);
            round(sun.cap(), lanes::LightExtent::radiance(&sun))
        }
        LightKind::Sphere { radius, .. } => round(radius, radiance),
        LightKind::Rectangle { axes, half, .. } => Extent { axes, half, radiance },
        LightKind::Disc { normal, radius, .. } => {
            Extent { axes: disc_axes(normal), half: [radius; 2], radiance }
        }
    })
}

/// Axes of a disc with unit `normal`.
fn disc_axes(normal: Vec3) -> [Vec3; 3] {
    let [across, along] = tangents(normal.to_array());
    [across.into(), along.into(), normal]
}
