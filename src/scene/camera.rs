//! The pinhole camera of the thesis (program 4.1): `d = 2*film - 1`, `direction = d.x*u + d.y*v + w`, rays start at
//! the eye.
//!
//! It is set up in f64 world coordinates, and used in f32 relative to the origin of the sequence. Row 0 of the image
//! is its top. [`super::path`] moves cameras, [`super::framing`] places them. [`super::lens`] adds depth of field.

use glam::{DMat4, DVec2, DVec3, DVec4, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::ray::Ray;

/// Default vertical field of view in degrees: that of a 29 mm lens for a film still (24 mm high), wide enough for a
/// sense of depth, and narrow enough for spheres to look round at the border.
pub const DEFAULT_FOV: f64 = 45.0;

/// Position and orientation of a camera in world units, as in a manifest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraView {
    /// Position of the pinhole.
    pub eye: DVec3,
    /// The point at the centre of the image.
    pub look_at: DVec3,
    /// The up direction; need not be perpendicular to the view.
    pub up: DVec3,
    /// Vertical field of view in degrees, above 0 and below 180.
    pub fov: f64,
}

/// Reasons why a camera cannot be set up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum CameraError {
    /// A coordinate is NaN or infinite.
    #[error("a coordinate is not a finite number")]
    NotFinite,
    /// A coordinate exceeds the range of f32.
    #[error("eye or look_at is too far away for single precision (limit 3e38)")]
    TooFar,
    /// `eye` and `look_at` are the same point.
    #[error("eye and look_at are the same point; move one of them")]
    NoDirection,
    /// `up` is zero or parallel to the view.
    #[error("up is zero or points along the view; choose another camera.up")]
    NoUp,
    /// Field of view outside 0 to 180 degrees.
    #[error("fov must be above 0 and below 180 degrees")]
    FieldOfView,
    /// The aspect ratio is zero, negative or not finite.
    #[error("image width over height must be above 0")]
    Aspect,
    /// The focus is behind the camera, at the camera, or infinitely far away.
    #[error(
        "the focus is not in front of the camera; set camera.focus to a distance, or follow another particle"
    )]
    Focus,
    /// The diameter of the aperture is out of range.
    #[error(
        "the aperture is too large for single precision; raise camera.f_stop, or lower camera.aperture"
    )]
    Aperture,
}

/// The lens of a camera for one image, in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Radius of the aperture.
    pub radius: f32,
    /// Distance of the plane in focus, along the view axis.
    pub focus: f32,
}

/// A camera that generates rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// `tan(fov / 2)`, horizontal and vertical.
    half_extent: Vec2,
    /// The lens; without one, the camera is a pinhole.
    lens: Option<Lens>,
    /// World to camera space: x right, y up, z forward (left-handed, as in OpenEXR's `worldToCamera`).
    camera_from_world: DMat4,
}

impl Camera {
    /// A camera at `view`, for images with `aspect` = width / height. Its coordinates are relative to `origin`.
    ///
    /// # Errors
    /// If the direction or the up vector of the view is undefined, or if a number is out of range.
    pub fn new(view: &CameraView, aspect: f64, origin: DVec3) -> Result<Self, CameraError> {
        // Check the view
        let points = [view.eye, view.look_at, view.up, origin];
        if !points.iter().all(|p| p.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let is_representable = |p: DVec3| (p - origin).as_vec3().is_finite();
        if !is_representable(view.eye) || !is_representable(view.look_at) {
            return Err(CameraError::TooFar);
        }
        if !(view.fov > 0.0 && view.fov < 180.0) {
            return Err(CameraError::FieldOfView);
        }
        if !(aspect > 0.0 && aspect.is_finite()) {
            return Err(CameraError::Aspect);
        }
        // Build an orthonormal basis
        let forward = (view.look_at - view.eye)
            .try_normalize()
            .ok_or(CameraError::NoDirection)?;
        let up_hint = view.up.try_normalize().ok_or(CameraError::NoUp)?;
        let right = forward.cross(up_hint);
        // For smaller values, rounding of the input determines the up direction.
        if right.length() < 1e-9 {
            return Err(CameraError::NoUp);
        }
        let right = right.normalize();
        let up = right.cross(forward);
        let half_height = libm::tan(0.5 * view.fov.to_radians());
        Ok(Self {
            eye: (view.eye - origin).as_vec3(),
            right: right.as_vec3(),
            up: up.as_vec3(),
            forward: forward.as_vec3(),
            half_extent: DVec2::new(half_height * aspect, half_height).as_vec2(),
            lens: None,
            camera_from_world: camera_from_world(view.eye, right, up, forward),
        })
    }

    /// The camera with a lens around its eye. An aperture of 0 is a pinhole.
    #[must_use]
    pub fn with_lens(self, lens: Lens) -> Self {
        let lens = (lens.radius > 0.0).then_some(lens);
        Self { lens, ..self }
    }

    /// The ray through the eye and through `film`, in units of the image: (0, 0) is the top left corner, (1, 1) the bottom right one.
    pub fn ray(&self, film: Vec2) -> Ray {
        let d = Vec2::new(2.0 * film.x - 1.0, 1.0 - 2.0 * film.y) * self.half_extent;
        let direction = self.forward + d.x * self.right + d.y * self.up;
        Ray::new(self.eye, direction.normalize())
    }

    /// The view axis.
    pub const fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Unit vectors to the right, up, and along the view.
    pub(crate) const fn axes(&self) -> [Vec3; 3] {
        [self.right, self.up, self.forward]
    }

    /// The lens, unless the camera is a pinhole.
    pub(crate) const fn lens(&self) -> Option<Lens> {
        self.lens
    }

    /// Tangents of half the horizontal and vertical field of view.
    pub(crate) const fn half_extent(&self) -> Vec2 {
        self.half_extent
    }

    /// The position of the pinhole, or of the centre of the lens, relative to the origin of the sequence.
    pub const fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Distance of `point` from the eye along the view axis.
    pub fn depth_of(&self, point: Vec3) -> f32 {
        (point - self.eye).dot(self.forward)
    }

    /// The position on the film of `point`, in units of the image as in [`Self::ray`], as a pinhole sees it; None
    /// behind the camera.
    pub fn film_of(&self, point: Vec3) -> Option<Vec2> {
        let depth = self.depth_of(point);
        let to_point = point - self.eye;
        let across = Vec2::new(to_point.dot(self.right), -to_point.dot(self.up));
        (depth > 0.0).then(|| 0.5 + 0.5 * across / (depth * self.half_extent))
    }

    /// The matrix of OpenEXR's `worldToCamera` (row vectors, row by row; left-handed, y up, z forward, so that the
    /// third coordinate of a point is its `Z`).
    pub fn world_to_camera(&self) -> [f32; 16] {
        // Rows for row vectors equal columns for column vectors.
        self.camera_from_world.as_mat4().to_cols_array()
    }
}

/// The matrix from world points to camera space.
fn camera_from_world(eye: DVec3, right: DVec3, up: DVec3, forward: DVec3) -> DMat4 {
    let column = |x: DVec3| DVec4::new(right.dot(x), up.dot(x), forward.dot(x), 0.0);
    DMat4::from_cols(
        column(DVec3::X),
        column(DVec3::Y),
        column(DVec3::Z),
        DVec4::new(-right.dot(eye), -up.dot(eye), -forward.dot(eye), 1.0),
    )
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
