//! Bounds, view and lights of a cell: the box of the thesis with its camera, or the particles of a user in the
//! framing of `render`.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use spherule_tracer::scene::{
    Background, Bounds, Camera, CameraError, CameraView, DEFAULT_AMBIENT_LIGHT, Framed, Framing,
    Light, Scene, camera, default_lights,
};

use super::Motion;

/// The bounds that the camera moves around, and its still view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Box of most particles, world units.
    pub bounds: Bounds,
    /// The still view.
    pub view: CameraView,
    /// World position that coordinates are relative to.
    pub origin: DVec3,
    /// The lights.
    pub lighting: Lighting,
}

/// Sets of lights. With each of them, a visible point costs one shadow ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Lighting {
    /// A white point light ten units above the eye of the thesis, which does not specify its light.
    Point,
    /// The default lights of a picture.
    Studio,
}

impl Stage {
    /// The box and the camera of the thesis.
    pub const THESIS: Self = Self {
        bounds: Bounds { min: DVec3::new(3.0, 5.0, -2.0), max: DVec3::new(7.0, 8.0, 2.0) },
        view: CameraView {
            eye: DVec3::ZERO,
            look_at: DVec3::new(5.0, 5.0, 0.0),
            up: DVec3::Z,
            fov: camera::DEFAULT_FOV,
        },
        origin: DVec3::ZERO,
        lighting: Lighting::Point,
    };

    /// A three-quarter view of `bounds` for images with `aspect` = width / height.
    pub fn framing(bounds: Bounds, up: DVec3, aspect: f64, origin: DVec3) -> Self {
        Self {
            bounds,
            view: Framed::corners(&bounds).view(&Framing::three_quarter(up, aspect)),
            origin,
            lighting: Lighting::Studio,
        }
    }

    /// The scene at `t` in 0..1 of the camera path, without particles.
    ///
    /// # Errors
    /// The view is invalid.
    pub fn scene(&self, motion: Motion, t: f64, aspect: f64) -> Result<Scene, CameraError> {
        let view = motion.view_at(t, &self.view, self.bounds.center());
        let up = self.view.up;
        let lights = match self.lighting {
            Lighting::Point => {
                vec![Light::point(DVec3::new(0.0, 0.0, 10.0), self.origin, Vec3::ONE)]
            }
            Lighting::Studio => default_lights(&self.bounds, up, &self.view),
        };
        Ok(Scene {
            origin: self.origin,
            lights,
            ambient_light: DEFAULT_AMBIENT_LIGHT,
            background: Background::default_for(up.as_vec3()),
            ..Scene::new(Camera::new(&view, aspect, self.origin)?)
        })
    }
}
