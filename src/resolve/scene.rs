//! What the camera sees, apart from meshes and rods.

use glam::Vec3;

use super::camera::PlacedCamera;
use super::environment::{Surroundings, surroundings};
use super::ground::GroundPlace;
use super::{Extent, ResolveError, SceneInputs, ground, lights, mist, surface};
use crate::manifest::Manifest;
use crate::render::IntegratorKind;
use crate::scene::{Background, DEFAULT_AMBIENT_LIGHT, Scene, default_lights};
use crate::survey::Survey;

/// The scene at the start of the camera path.
///
/// # Errors
/// Light is not possible with the other settings.
pub(super) fn scene(
    manifest: &Manifest,
    survey: &Survey,
    inputs: &SceneInputs<'_>,
    placed: &PlacedCamera,
    extent: &Extent,
) -> Result<Scene, ResolveError> {
    // Find the lights: those of the manifest, the environment, and its sun
    let (up, bounds, view) = (extent.up, &extent.bounds, placed.view.path.start());
    let Surroundings { environment, suns } = surroundings(manifest, inputs, &view, up)?;
    let mut lights = match (manifest.lights.is_empty(), manifest.integrator()) {
        (false, _) => lights::lights(manifest, survey.origin, up)?,
        (true, IntegratorKind::Whitted) => default_lights(bounds, up, &view),
        // The environment is the light
        (true, IntegratorKind::Path) => Vec::new(),
    };
    lights.extend(suns);
    // Collect what the ground depends on
    let place = GroundPlace {
        bounds,
        reach: extent.reach,
        up,
        origin: survey.origin,
        has_layer: survey.rests_on_ground(up),
        is_of_earlier_version: survey.standing.is_none(),
        lowest: survey.lowest,
    };
    let mut scene = Scene {
        origin: survey.origin,
        camera: placed.camera,
        lights,
        ambient_light: DEFAULT_AMBIENT_LIGHT,
        materials: Scene::basic_materials(surface::material(manifest, bounds)),
        background: background(manifest, up.as_vec3()),
        ground: ground::ground(manifest, &place),
        wet_ground: ground::wet_ground(manifest, &place),
        mist: None,
        particles: [bounds.min, bounds.max].map(|corner| (corner - survey.origin).as_vec3()),
        environment,
        is_environment_visible: manifest.environment.visible,
        environment_group: lights::group_index(manifest, manifest.environment.group.as_ref()),
        next_frame: None,
        previous_frame: None,
        exposure: None,
    };
    scene.mist = mist::mist(manifest, bounds, &scene, up.as_vec3());
    scene.set_spray_soft(manifest.draws_soft_spray());
    Ok(scene)
}

fn background(manifest: &Manifest, up: Vec3) -> Background {
    match (manifest.render.background, manifest.integrator()) {
        (Some(background), _) => background.with_up(up),
        (None, IntegratorKind::Path) => Background::Studio { up },
        (None, IntegratorKind::Whitted) => Background::default_for(up),
    }
}
