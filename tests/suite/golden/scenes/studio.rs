//! Shots of path tracing.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use spherule::render::IntegratorKind;
use spherule::scene::environment::studio as studio_light;
use spherule::scene::{EnvironmentAxes, Finish, Ground, Material};

use super::{BLUE, GREEN, GREY, MATT, RED, Shot, floor};

/// A pile of plastic balls in a studio: they light each other, and their shadows lie on an invisible floor.
pub(in super::super) fn studio() -> Shot {
    let mut shot = Shot::new(
        vec![
            Vec3::new(-1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.1, 1.0),
            Vec3::new(0.1, 1.7, 1.0),
            Vec3::new(0.0, 0.6, 2.6),
        ],
        1.0,
        DVec3::new(0.0, -10.0, 4.0),
        DVec3::new(0.0, 0.0, 1.4),
    );
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    shot.scene.lights = Vec::new();
    shot.scene.environment = Some(Arc::new(studio_light(axes, Vec3::ONE)));
    *shot.scene.particle_material_mut() =
        Material { finish: Finish::Plastic { roughness: 0.4 }, ..MATT };
    shot.scene.ground = Some(Ground { shadow_catcher: Some(1.0), ..floor(0.0) });
    shot.settings.integrator = IntegratorKind::Path;
    shot.settings.samples = 32;
    shot.painted(&[RED, GREEN, BLUE, GREY])
}
