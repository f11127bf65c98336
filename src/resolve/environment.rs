//! The environment of the scene.

use std::sync::Arc;

use glam::DVec3;

use super::ResolveError;
use crate::manifest::{EnvironmentKind, Manifest};
use crate::render::IntegratorKind;
use crate::scene::camera::view_direction;
use crate::scene::environment::studio;
use crate::scene::{CameraView, Environment, EnvironmentAxes, RadianceMap};

/// Whether the environment is an image.
pub(super) fn needs_image(manifest: &Manifest) -> bool {
    manifest.render.integrator == IntegratorKind::Path
        && manifest.environment.kind == EnvironmentKind::Image
}

/// The environment of the path integrator, as it is placed by the first `view` of the camera.
pub(super) fn environment(
    manifest: &Manifest,
    map: Option<&RadianceMap>,
    view: &CameraView,
    up: DVec3,
) -> Result<Option<Arc<Environment>>, ResolveError> {
    if manifest.render.integrator != IntegratorKind::Path {
        return Ok(None);
    }
    let settings = &manifest.environment;
    let scale = settings.intensity * settings.color;
    let axes = |forward| EnvironmentAxes::of_view(forward, up, settings.rotation);
    let environment = match settings.kind {
        EnvironmentKind::Studio => studio(axes(view.look_at - view.eye), scale),
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
