//! The environment of the scene.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::ResolveError;
use super::lights::group_index;
use crate::manifest::{EnvironmentKind, Manifest};
use crate::render::IntegratorKind;
use crate::scene::environment::{sky, sky_direction, studio};
use crate::scene::framing::view_direction;
use crate::scene::{self, CameraView, Environment, EnvironmentAxes, Light, RadianceMap};

/// Whether the environment is an image.
pub(super) fn needs_image(manifest: &Manifest) -> bool {
    manifest.integrator() == IntegratorKind::Path
        && manifest.environment.kind == EnvironmentKind::Image
}

/// The environment of the path integrator, as it is placed by the first `view` of the camera.
pub(super) fn environment(
    manifest: &Manifest,
    map: Option<&RadianceMap>,
    view: &CameraView,
    up: DVec3,
) -> Result<Option<Arc<Environment>>, ResolveError> {
    if manifest.integrator() != IntegratorKind::Path {
        return Ok(None);
    }
    // Its directions are relative to the view
    let settings = &manifest.environment;
    let scale = settings.intensity * settings.color;
    let axes = |forward| EnvironmentAxes::of_view(forward, up, settings.rotation);
    // Make it; a studio and a sky turn with the camera, an image stays where it is
    let environment = match settings.kind {
        EnvironmentKind::Studio => studio(axes(view.heading(up)), scale),
        EnvironmentKind::Sky => {
            let sun = &settings.sun;
            let direction = sky_direction(sun.elevation, sun.azimuth);
            sky(axes(view.heading(up)), direction, scale)
        }
        EnvironmentKind::Constant => Environment::constant(scale),
        EnvironmentKind::Image => {
            let map = map.ok_or_else(|| ResolveError::Unsupported {
                key: "environment.image",
                what: "the image has not been read".to_owned(),
            })?;
            let forward = view_direction(up.normalize_or(DVec3::Z), 0.0, 0.0);
            Environment::from_map(axes(forward), map, scale)
        }
    };
    Ok(Some(Arc::new(environment)))
}

/// Irradiance of the sun of a sky on a surface that faces it, over pi: warm, and brighter than the sky.
const SUN: Vec3 = Vec3::new(1.8, 1.674, 1.476);

/// The sun of the sky, if that is the environment.
pub(super) fn sun(manifest: &Manifest, view: &CameraView, up: DVec3) -> Option<Light> {
    let settings = &manifest.environment;
    let is_sky =
        manifest.integrator() == IntegratorKind::Path && settings.kind == EnvironmentKind::Sky;
    is_sky.then(|| {
        let axes = EnvironmentAxes::of_view(view.heading(up), up, settings.rotation);
        let sun = &settings.sun;
        Light {
            kind: scene::LightKind::Sun {
                to_light: axes.to_world(sky_direction(sun.elevation, sun.azimuth)),
                half_angle: (0.5 * sun.size).to_radians(),
            },
            radiance: std::f32::consts::PI * SUN * settings.intensity * settings.color,
            casts_shadow: true,
            is_visible: settings.visible,
            group: group_index(manifest, settings.group.as_ref()),
        }
    })
}
