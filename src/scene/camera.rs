//! The pinhole camera of the thesis (program 4.1): `d = 2*film - 1`,
//! `direction = d.x*u + d.y*v + w`, rays start at the eye.
//!
//! Set up in f64 world coordinates, used in f32 relative to the sequence's origin. Row 0 of the
//! image is its top. How a camera moves is [`super::path`]'s business; lens blur is left to later.

use glam::{DMat4, DVec2, DVec3, DVec4, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Bounds;
use crate::ray::Ray;

/// Vertical field of view where none is given, degrees: about a 29 mm lens on a film still's
/// height (24 mm), close enough for depth and far enough to keep spheres round at the rim.
pub const DEFAULT_FOV: f64 = 45.0;

/// Part of the image's half width and height left free around a framed box.
pub const FRAMING_MARGIN: f64 = 0.08;

/// Turn around `up` of the default view, degrees: two sides of a box in unequal parts.
pub const DEFAULT_AZIMUTH: f64 = 30.0;

/// Height of the default view over the horizon, degrees: enough to see the top of the material.
pub const DEFAULT_ELEVATION: f64 = 20.0;

/// Where a camera stands and looks, in world units, as a manifest has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraView {
    /// Position of the pinhole.
    pub eye: DVec3,
    /// A point in the middle of the image.
    pub look_at: DVec3,
    /// Which way is up; need not be perpendicular to the view.
    pub up: DVec3,
    /// Vertical field of view in degrees, above 0 and below 180.
    pub fov: f64,
}

/// How [`Camera::framing`] looks at a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// The world's up.
    pub up: DVec3,
    /// Turn around `up` in degrees; 0 looks along +y if `up` is z, along -z if `up` is y.
    pub azimuth: f64,
    /// Height over the horizon in degrees; positive looks down.
    pub elevation: f64,
    /// Vertical field of view in degrees.
    pub fov: f64,
    /// Width over height of the image.
    pub aspect: f64,
}

impl Framing {
    /// The default three-quarter view.
    pub const fn three_quarter(up: DVec3, aspect: f64) -> Self {
        Self {
            up,
            azimuth: DEFAULT_AZIMUTH,
            elevation: DEFAULT_ELEVATION,
            fov: DEFAULT_FOV,
            aspect,
        }
    }
}

/// Why a camera cannot be set up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum CameraError {
    /// A coordinate is NaN or infinite.
    #[error("a coordinate is not a finite number")]
    NotFinite,
    /// The renderer works in f32.
    #[error("eye or look_at is too far away for single precision, whose numbers end at 3e38")]
    TooFar,
    /// There is no direction to look in.
    #[error("eye and look_at are the same point; move one of them")]
    NoDirection,
    /// `up` is zero or along the view.
    #[error("up is zero or points along the view; choose another camera.up")]
    NoUp,
    /// Field of view outside 0 to 180 degrees.
    #[error("fov must lie above 0 and below 180 degrees")]
    FieldOfView,
    /// Width over height is zero, negative or not finite.
    #[error("image width over height must be above 0")]
    Aspect,
}

/// A camera ready to make rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// `tan(fov / 2)`, horizontal and vertical.
    half_extent: Vec2,
    /// To camera space: x right, y up, z forward (left-handed as OpenEXR's `worldToCamera`).
    camera_from_world: DMat4,
}

impl Camera {
    /// A camera at `view`, for images of `aspect` = width / height; coordinates become relative to
    /// `origin`.
    ///
    /// # Errors
    /// If the view has no direction, no up, or a number that makes no picture.
    pub fn new(view: &CameraView, aspect: f64, origin: DVec3) -> Result<Self, CameraError> {
        let points = [view.eye, view.look_at, view.up, origin];
        if !points.iter().all(|p| p.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        let is_near = |p: DVec3| (p - origin).as_vec3().is_finite();
        if !is_near(view.eye) || !is_near(view.look_at) {
            return Err(CameraError::TooFar);
        }
        if !(view.fov > 0.0 && view.fov < 180.0) {
            return Err(CameraError::FieldOfView);
        }
        if !(aspect > 0.0 && aspect.is_finite()) {
            return Err(CameraError::Aspect);
        }
        let forward = (view.look_at - view.eye)
            .try_normalize()
            .ok_or(CameraError::NoDirection)?;
        let up_hint = view.up.try_normalize().ok_or(CameraError::NoUp)?;
        let right = forward.cross(up_hint);
        // Below this, rounding of the inputs decides where up is.
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
            camera_from_world: camera_from_world(view.eye, right, up, forward),
        })
    }

    /// The nearest view from the asked direction that has all corners of `bounds` in the image,
    /// with a margin of [`FRAMING_MARGIN`]. An empty or flat box gives a view too.
    ///
    /// The image planes through the eye must touch the box on both sides: with `x`, `d` a corner's
    /// place across and along the view and `t` the half extent, `|x - c| <= t (D + d)` for all
    /// corners has its least `D` at `c` midway between the outermost `x - t d` and `x + t d`.
    pub fn framing(bounds: &Bounds, framing: &Framing) -> CameraView {
        let up = framing.up.try_normalize().unwrap_or(DVec3::Z);
        let direction = view_direction(up, framing.azimuth, framing.elevation);
        let right = direction.cross(up).try_normalize().unwrap_or(DVec3::X);
        let screen_up = right.cross(direction);
        let half = half_extent(framing);

        let center = bounds.center();
        let relative = bounds.corners().map(|corner| corner - center);
        let (x, distance_x) = fit(&relative, direction, right, half.x);
        let (y, distance_y) = fit(&relative, direction, screen_up, half.y);
        let distance = distance_x.max(distance_y).max(least_distance(bounds));
        let look_at = center + x * right + y * screen_up;
        CameraView {
            eye: look_at - distance * direction,
            look_at,
            up,
            fov: framing.fov,
        }
    }

    /// The ray through `film` in units of the image: (0, 0) is the top left corner of the image,
    /// (1, 1) the bottom right one.
    pub fn ray(&self, film: Vec2) -> Ray {
        let d = Vec2::new(2.0 * film.x - 1.0, 1.0 - 2.0 * film.y) * self.half_extent;
        let direction = self.forward + d.x * self.right + d.y * self.up;
        Ray::new(self.eye, direction.normalize())
    }

    /// The view axis.
    pub const fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Unit vectors to the right, up and along the view.
    pub(crate) const fn axes(&self) -> [Vec3; 3] {
        [self.right, self.up, self.forward]
    }

    /// Tangents of half the horizontal and vertical field of view.
    pub(crate) const fn half_extent(&self) -> Vec2 {
        self.half_extent
    }

    /// The pinhole, relative to the sequence's origin.
    pub const fn eye(&self) -> Vec3 {
        self.eye
    }

    /// The matrix of OpenEXR's `worldToCamera` (row vectors, row by row; left-handed, y up, z
    /// forward, so that a point's third coordinate is its `Z`).
    pub fn world_to_camera(&self) -> [f32; 16] {
        // Rows for row vectors are the columns for column vectors.
        self.camera_from_world.as_mat4().to_cols_array()
    }
}

/// Columns of the matrix that takes world points to camera space.
fn camera_from_world(eye: DVec3, right: DVec3, up: DVec3, forward: DVec3) -> DMat4 {
    let column = |x: DVec3| DVec4::new(right.dot(x), up.dot(x), forward.dot(x), 0.0);
    DMat4::from_cols(
        column(DVec3::X),
        column(DVec3::Y),
        column(DVec3::Z),
        DVec4::new(-right.dot(eye), -up.dot(eye), -forward.dot(eye), 1.0),
    )
}

/// What a framed box may fill of the picture, horizontally and vertically: its extent at distance 1 from
/// the middle to the rim, without the margin.
pub(super) fn half_extent(framing: &Framing) -> DVec2 {
    let half_height = libm::tan(0.5 * framing.fov.to_radians()) * (1.0 - FRAMING_MARGIN);
    DVec2::new(half_height * framing.aspect, half_height)
}

/// Distance without which nothing could be seen of `bounds`, although all of it would fit.
pub(super) fn least_distance(bounds: &Bounds) -> f64 {
    // A single point still needs some; the scale of its coordinates is all we have.
    if bounds.diagonal() > 0.0 {
        0.0
    } else {
        (1e-3 * bounds.center().length()).max(1.0)
    }
}

/// The way a camera looks that stands at `azimuth` and `elevation` (degrees) around `up`.
pub(super) fn view_direction(up: DVec3, azimuth: f64, elevation: f64) -> DVec3 {
    // Straight down would leave no up; a degree is not seen.
    let elevation = elevation.clamp(-89.0, 89.0).to_radians();
    let azimuth = azimuth.to_radians();
    let hint = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let right = (hint - hint.dot(up) * up).normalize();
    let front = right.cross(up);
    let level = libm::cos(azimuth) * front + libm::sin(azimuth) * right;
    -(libm::cos(elevation) * level + libm::sin(elevation) * up)
}

/// Shift along `axis` and distance along `direction` at which all `corners` lie within
/// `half_extent`.
fn fit(corners: &[DVec3; 8], direction: DVec3, axis: DVec3, half_extent: f64) -> (f64, f64) {
    let mut high = f64::NEG_INFINITY;
    let mut low = f64::INFINITY;
    for corner in corners {
        let (x, d) = (corner.dot(axis), corner.dot(direction));
        high = high.max(x - half_extent * d);
        low = low.min(x + half_extent * d);
    }
    (0.5 * (high + low), 0.5 * (high - low) / half_extent)
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
