//! The pinhole camera of the thesis (program 4.1): `d = 2*film - 1`, `direction = d.x*u + d.y*v + w`, rays start at
//! the eye. [`super::projection`] has other projections.
//!
//! It is set up in f64 world coordinates, and used in f32 relative to the origin of the sequence. Row 0 of the image
//! is its top. [`super::path`] moves cameras, [`super::framing`] places them. [`super::lens`] adds depth of field.

use glam::{DMat4, DVec3, DVec4, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::projection::Projection;
use spherule_tree::ray::Ray;

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

/// Sine of the angle to the up direction below which a view is one from straight above or below.
const STEEP: f64 = 1e-3;

impl CameraView {
    /// The direction of the view; for one along `up`, the direction that points up in the image.
    pub fn heading(&self, up: DVec3) -> DVec3 {
        let forward = self.look_at - self.eye;
        if forward.cross(up).length() < STEEP * forward.length() * up.length() {
            self.up
        } else {
            forward
        }
    }
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
    /// The height of an orthographic image is zero, negative, or out of range in single precision.
    #[error("the height of the picture is out of range; choose another camera.height")]
    Height,
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
    /// The distance of the eyes of a stereo pair is out of range.
    #[error(
        "the distance or the convergence of the eyes is out of range in single precision; choose another \
         camera.eye_distance or camera.convergence"
    )]
    Eyes,
}

/// The lens of a camera for one image, in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Radius of the aperture.
    pub radius: f32,
    /// Distance of the plane in focus, along the view axis.
    pub focus: f32,
}

/// A pair of eyes, in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stereo {
    /// Half the distance of the eyes, which are to the left and to the right of the eye of the camera.
    pub half_distance: f32,
    /// Distance along the view axis of the plane that both eyes see at the same positions of their images; infinite if
    /// the eyes look in parallel directions.
    pub convergence: f32,
}

/// A camera that generates rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    projection: Projection,
    half_extent: Vec2,
    /// The lens; without one, the camera is a pinhole.
    lens: Option<Lens>,
    /// The eyes, if there are two.
    stereo: Option<Stereo>,
    /// World to camera space: x right, y up, z forward (left-handed, as in OpenEXR's `worldToCamera`).
    camera_from_world: DMat4,
}

impl Camera {
    /// A pinhole camera at `view`, for images with `aspect` = width / height. Its coordinates are relative to `origin`.
    ///
    /// # Errors
    /// If the direction or the up vector of the view is undefined, or if a number is out of range.
    pub fn new(view: &CameraView, aspect: f64, origin: DVec3) -> Result<Self, CameraError> {
        Self::projected(view, Projection::Perspective, aspect, origin)
    }

    /// A camera with any projection. For a panorama, the axis to the front is the direction of the view without its
    /// part along `up`.
    ///
    /// # Errors
    /// Same as [`Self::new`].
    pub fn projected(
        view: &CameraView,
        projection: Projection,
        aspect: f64,
        origin: DVec3,
    ) -> Result<Self, CameraError> {
        // Check the view
        let points = [view.eye, view.look_at, view.up, origin];
        if !points.iter().all(|p| p.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let is_representable = |p: DVec3| (p - origin).as_vec3().is_finite();
        if !is_representable(view.eye) || !is_representable(view.look_at) {
            return Err(CameraError::TooFar);
        }
        if !(aspect > 0.0 && aspect.is_finite()) {
            return Err(CameraError::Aspect);
        }
        let half_extent = projection.half_extent(view.fov, aspect).ok_or(match projection {
            Projection::Orthographic { .. } => CameraError::Height,
            _ => CameraError::FieldOfView,
        })?;
        // Build an orthonormal basis
        let forward = (view.look_at - view.eye).try_normalize().ok_or(CameraError::NoDirection)?;
        let up_hint = view.up.try_normalize().ok_or(CameraError::NoUp)?;
        let right = forward.cross(up_hint);
        // For smaller values, rounding of the input determines the up direction.
        if right.length() < 1e-9 {
            return Err(CameraError::NoUp);
        }
        let right = right.normalize();
        let (up, forward) = if projection.is_panorama() {
            (up_hint, up_hint.cross(right))
        } else {
            (right.cross(forward), forward)
        };
        Ok(Self {
            eye: (view.eye - origin).as_vec3(),
            right: right.as_vec3(),
            up: up.as_vec3(),
            forward: forward.as_vec3(),
            projection,
            half_extent: half_extent.as_vec2(),
            lens: None,
            stereo: None,
            camera_from_world: camera_from_world(view.eye, right, up, forward),
        })
    }

    /// The camera with a lens around its eye. An aperture of 0 is a pinhole.
    #[must_use]
    pub fn with_lens(self, lens: Lens) -> Self {
        let lens = (lens.radius > 0.0).then_some(lens);
        Self { lens, ..self }
    }

    /// The camera with two eyes.
    #[must_use]
    pub fn with_stereo(self, stereo: Option<Stereo>) -> Self {
        Self { stereo, ..self }
    }

    /// The ray from the eye through `film`, in units of the image: (0, 0) is the top left corner, (1, 1) the bottom
    /// right one.
    pub fn ray(&self, film: Vec2) -> Ray {
        let d = Vec2::new(2.0 * film.x - 1.0, 1.0 - 2.0 * film.y) * self.half_extent;
        let on_axes = self.projection.direction(d.to_array());
        let direction = on_axes.z * self.forward + on_axes.x * self.right + on_axes.y * self.up;
        let origin = if self.projection.has_one_origin() {
            self.eye
        } else {
            self.eye + d.x * self.right + d.y * self.up
        };
        Ray::new(origin, direction.normalize())
    }

    /// The projection.
    pub const fn projection(&self) -> Projection {
        self.projection
    }

    /// The view axis.
    pub const fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Unit vectors to the right, up, and along the view.
    pub const fn axes(&self) -> [Vec3; 3] {
        [self.right, self.up, self.forward]
    }

    /// The lens, unless the camera is a pinhole.
    pub const fn lens(&self) -> Option<Lens> {
        self.lens
    }

    /// The two eyes, if there are two.
    pub const fn stereo(&self) -> Option<Stereo> {
        self.stereo
    }

    /// Number of images beside each other and below each other in a picture: the left eye is at the left, or in a
    /// panorama above.
    pub const fn eyes(&self) -> [u32; 2] {
        eyes(self.projection, self.stereo.is_some())
    }

    /// Half the width and the height of the film: tangents in perspective, lengths if orthographic, angles in a
    /// panorama.
    pub const fn half_extent(&self) -> Vec2 {
        self.half_extent
    }

    /// The position of the pinhole, or of the centre of the lens, relative to the origin of the sequence.
    pub const fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Distance of `point` from the eye along the view axis; in a panorama, in any direction.
    pub fn depth_of(&self, point: Vec3) -> f32 {
        if self.projection.is_panorama() {
            (point - self.eye).length()
        } else {
            (point - self.eye).dot(self.forward)
        }
    }

    /// The position on the film of `point`, in units of the image as in [`Self::ray`], without a lens; None behind the
    /// camera.
    pub fn film_of(&self, point: Vec3) -> Option<Vec2> {
        let to_point = point - self.eye;
        let on_axes = [self.right, self.up, self.forward].map(|axis| to_point.dot(axis));
        let d = self.projection.project(on_axes.into())? / self.half_extent;
        Some(0.5 + 0.5 * Vec2::new(d.x, -d.y))
    }

    /// The matrix of OpenEXR's `worldToCamera` (row vectors, row by row; left-handed, y up, z forward, so that the
    /// third coordinate of a point is its `Z`).
    pub fn world_to_camera(&self) -> [f32; 16] {
        // Rows for row vectors equal columns for column vectors.
        self.camera_from_world.as_mat4().to_cols_array()
    }

    /// The matrix of OpenEXR's `worldToNDC`, in the form of [`Self::world_to_camera`]: the film is -1 to 1 on both axes,
    /// x to the right and y up. In perspective, the third coordinate is 1 minus the reciprocal of the depth. None if no
    /// matrix projects points onto the film: for panoramas, and for two eyes.
    pub fn world_to_ndc(&self) -> Option<[f32; 16]> {
        let [x, y] = self.half_extent.as_dvec2().recip().to_array();
        let ndc_from_camera = match self.projection {
            _ if self.stereo.is_some() => return None,
            Projection::Perspective => DMat4::from_cols(
                DVec4::X * x,
                DVec4::Y * y,
                DVec4::new(0.0, 0.0, 1.0, 1.0),
                DVec4::new(0.0, 0.0, -1.0, 0.0),
            ),
            Projection::Orthographic { .. } => DMat4::from_scale(DVec3::new(x, y, 1.0)),
            Projection::Equirectangular => return None,
        };
        Some((ndc_from_camera * self.camera_from_world).as_mat4().to_cols_array())
    }

    /// Width of the film for OpenEXR's `screenWindowWidth`: at distance 1 in perspective, a length if orthographic. None
    /// as for [`Self::world_to_ndc`].
    pub fn screen_window_width(&self) -> Option<f32> {
        let is_flat = self.stereo.is_none() && !self.projection.is_panorama();
        is_flat.then_some(2.0 * self.half_extent.x)
    }

    /// The horizontal and the vertical field of view in degrees; None unless it is one eye in perspective.
    pub fn field_of_view(&self) -> Option<[f32; 2]> {
        let is_perspective = self.projection == Projection::Perspective && self.stereo.is_none();
        let degrees = |half: f32| 2.0 * libm::atanf(half).to_degrees();
        is_perspective.then(|| self.half_extent.to_array().map(degrees))
    }
}

/// Number of images beside each other and below each other in a picture.
pub const fn eyes(projection: Projection, is_stereo: bool) -> [u32; 2] {
    match (is_stereo, projection.is_panorama()) {
        (false, _) => [1, 1],
        (true, false) => [2, 1],
        (true, true) => [1, 2],
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
