//! How a camera projects the scene onto the film.
//!
//! A point of the film has the coordinates `a` to the right and `b` upwards, from the middle. In each projection, they
//! define a ray.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, Vec2, Vec3};

use spherule_tree::math::functions::{asin, atan2, sin_cos};

/// The projection of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Projection {
    /// Rays start at the eye; `a` and `b` are tangents.
    #[default]
    Perspective,
    /// Rays are parallel to the view axis, and start in the plane of the eye; `a` and `b` are lengths.
    Orthographic {
        /// Height of the image in scene units.
        height: f64,
    },
    /// Rays start at the eye, in all directions; `a` is the longitude and `b` the latitude. The horizon, perpendicular
    /// to the up direction, is the middle row of the image.
    Equirectangular,
}

/// Sides of an orthographic film whose pixels have a width in single precision.
const LENGTHS: std::ops::Range<f64> = 1e-30..1e30;

impl Projection {
    /// Half the width and the height of the film, for a vertical field of view in degrees, which only matters in
    /// perspective. None if a number is out of range.
    pub(super) fn half_extent(self, fov: f64, aspect: f64) -> Option<DVec2> {
        let half_height = match self {
            Self::Perspective if fov > 0.0 && fov < 180.0 => libm::tan(0.5 * fov.to_radians()),
            Self::Orthographic { height } if LENGTHS.contains(&(height * aspect.min(1.0))) => {
                0.5 * height
            }
            Self::Equirectangular => return Some(DVec2::new(PI, FRAC_PI_2)),
            Self::Perspective | Self::Orthographic { .. } => return None,
        };
        Some(DVec2::new(half_height * aspect, half_height))
    }

    /// Whether the image shows all directions.
    pub const fn is_panorama(self) -> bool {
        matches!(self, Self::Equirectangular)
    }

    /// Whether all rays start at the eye.
    pub const fn has_one_origin(self) -> bool {
        !matches!(self, Self::Orthographic { .. })
    }

    /// The direction of the ray through `[a, b]`, in units of the axes to the right, up and forward.
    pub(super) fn direction(self, [a, b]: [f32; 2]) -> Vec3 {
        match self {
            Self::Perspective => Vec3::new(a, b, 1.0),
            Self::Orthographic { .. } => Vec3::Z,
            Self::Equirectangular => {
                let ((sin_a, cos_a), (sin_b, cos_b)) = (sin_cos(a), sin_cos(b));
                Vec3::new(cos_b * sin_a, sin_b, cos_b * cos_a)
            }
        }
    }

    /// The coordinates on the film of a point at `p` to the right, up and forward of the eye; None behind the camera.
    pub(crate) fn project(self, p: Vec3) -> Option<Vec2> {
        match self {
            Self::Perspective => (p.z > 0.0).then(|| Vec2::new(p.x, p.y) / p.z),
            Self::Orthographic { .. } => (p.z > 0.0).then(|| Vec2::new(p.x, p.y)),
            Self::Equirectangular => {
                let height = p.y / p.length();
                (height.abs() <= 1.0).then(|| Vec2::new(atan2(p.x, p.z), asin(height)))
            }
        }
    }
}
