//! What is looked at and from where: the thesis's box with its camera, or a user's particles framed
//! as `render` would.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::Motion;
use crate::scene::{
    Background, Bounds, Camera, CameraError, CameraView, DEFAULT_AMBIENT_LIGHT, Framing, Light,
    Material, Scene, camera, default_lights,
};

/// What the camera moves around, and where it stands when it does not move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// The bulk of the particles, world units.
    pub bounds: Bounds,
    /// The still view.
    pub view: CameraView,
    /// World position that coordinates are relative to.
    pub origin: DVec3,
    /// Which lights there are.
    pub lighting: Lighting,
}

/// Which lights there are. Either way a point that is seen costs one shadow ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Lighting {
    /// A white point light ten units above the thesis's eye; the thesis does not tell its own.
    Point,
    /// The lights that a picture has unless told otherwise.
    Studio,
}

impl Stage {
    /// The thesis's: its box, its camera.
    pub const THESIS: Self = Self {
        bounds: Bounds {
            min: DVec3::new(3.0, 5.0, -2.0),
            max: DVec3::new(7.0, 8.0, 2.0),
        },
        view: CameraView {
            eye: DVec3::ZERO,
            look_at: DVec3::new(5.0, 5.0, 0.0),
            up: DVec3::Z,
            fov: camera::DEFAULT_FOV,
        },
        origin: DVec3::ZERO,
        lighting: Lighting::Point,
    };

    /// A three-quarter view of `bounds` for images of `aspect` = width / height.
    pub fn framing(bounds: Bounds, up: DVec3, aspect: f64, origin: DVec3) -> Self {
        Self {
            bounds,
            view: Camera::framing(&bounds, &Framing::three_quarter(up, aspect)),
            origin,
            lighting: Lighting::Studio,
        }
    }

    /// Everything but the particles, as seen at `t` in 0..1 of the camera's way.
    ///
    /// # Errors
    /// The view makes no picture.
    pub fn scene(&self, motion: Motion, t: f64, aspect: f64) -> Result<Scene, CameraError> {
        let view = motion.view_at(t, &self.view, self.bounds.center());
        let up = self.view.up;
        let lights = match self.lighting {
            Lighting::Point => vec![Light::point(
                DVec3::new(0.0, 0.0, 10.0),
                self.origin,
                Vec3::ONE,
            )],
            Lighting::Studio => default_lights(&self.bounds, up, &self.view),
        };
        Ok(Scene {
            origin: self.origin,
            camera: Camera::new(&view, aspect, self.origin)?,
            lights,
            ambient_light: DEFAULT_AMBIENT_LIGHT,
            material: Material::DEFAULT,
            background: Background::default_for(up.as_vec3()),
            ground: None,
        })
    }
}
