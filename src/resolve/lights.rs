//! The light sources of the scene.

use crate::math::narrow;
use glam::{DVec3, Vec3};

use super::ResolveError;
use crate::manifest::{self, LightGroup, LightKind, Manifest};
use crate::render::IntegratorKind;
use crate::scene::{self, Light};

/// The lights of `[[light]]`, relative to `origin`.
///
/// # Errors
/// A light has an extent, but the integrator cannot use it.
pub(super) fn lights(
    manifest: &Manifest,
    origin: DVec3,
    up: DVec3,
) -> Result<Vec<Light>, ResolveError> {
    let mut lights = Vec::new();
    for light in &manifest.lights {
        // A light without a direction lights nothing
        let Some(mut found) = light_of(light, origin, up) else {
            continue;
        };
        found.group = group_index(manifest, light.group.as_ref());
        // The Whitted integrator samples points only
        if found.kind.has_extent() && manifest.integrator() == IntegratorKind::Whitted {
            return Err(ResolveError::Unsupported {
                key: "light.type",
                what: format!(
                    "render.integrator = \"whitted\" has no \"{}\" lights; choose \"path\" (--integrator path), or a \
                     point or directional light",
                    light.kind.type_name()
                ),
            });
        }
        lights.push(found);
    }
    Ok(lights)
}

/// Index of `group` among the light groups; 0 for light without a group, and if there are no layers for groups.
pub(super) fn group_index(manifest: &Manifest, group: Option<&LightGroup>) -> u8 {
    let names = manifest.light_groups();
    let index = group.and_then(|group| names.iter().position(|name| *name == group.as_str()));
    index.map_or(0, |index| u8::try_from(1 + index).unwrap_or(0))
}

fn light_of(light: &manifest::Light, origin: DVec3, up: DVec3) -> Option<Light> {
    let radiance = light.color * light.intensity;
    let relative = |position: DVec3| (position - origin).as_vec3();
    // Lights without an extent have constructors of their own
    let kind = match light.kind {
        LightKind::Point { position, falloff } => {
            return Some(Light::point_with(position, origin, radiance, falloff));
        }
        LightKind::Directional { direction } => {
            return Light::directional(direction.as_vec3(), radiance);
        }
        LightKind::Sun { direction, size } => scene::LightKind::Sun {
            to_light: -unit(direction),
            half_angle: (0.5 * size).to_radians(),
        },
        LightKind::Sphere { position, radius } => {
            scene::LightKind::Sphere { center: relative(position), radius: narrow(radius) }
        }
        LightKind::Rect { position, direction, width, height } => scene::LightKind::Rectangle {
            center: relative(position),
            axes: axes(direction, up),
            half: [narrow(0.5 * width), narrow(0.5 * height)],
        },
        LightKind::Disc { position, direction, radius } => scene::LightKind::Disc {
            center: relative(position),
            normal: unit(direction),
            radius: narrow(radius),
        },
    };
    Some(Light { kind, radiance, casts_shadow: true, is_visible: light.visible, group: 0 })
}

/// The unit vector along `direction`, which is not zero.
fn unit(direction: DVec3) -> Vec3 {
    // Neither very short nor very long vectors may vanish
    let scaled = direction / direction.abs().max_element();
    scaled.normalize_or(DVec3::NEG_Z).as_vec3()
}

/// Axes of a rectangle that faces `direction`: its width is horizontal.
fn axes(direction: DVec3, up: DVec3) -> [Vec3; 3] {
    let facing = unit(direction);
    let up = up.normalize_or(DVec3::Z).as_vec3();
    let width = up.cross(facing).try_normalize();
    // One that faces straight up or down has no other preferred direction
    let width = width.unwrap_or_else(|| facing.any_orthonormal_vector());
    [width, facing.cross(width), facing]
}
