//! The environment: light from infinitely far away, from every direction.
//!
//! Every kind of environment is an image in latitude and longitude (`image.rs`), which mirrors and the camera see, and
//! a table of texels of equal solid angle to sample directions from (`table.rs`), which lights everything else. The
//! table has the means of the image: texels of it are as small as details that matter for light on rough surfaces. Of a
//! larger image, mirrors and the camera see its own pixels (`detail.rs`), and suns in it are lights (`suns.rs`).
//!
//! All functions of a direction are free of calls, so that loops over lanes can use them; they return the same bits
//! on every platform.

use std::sync::Arc;

use glam::{DVec3, Vec3};

mod atmosphere;
mod detail;
mod distribution;
mod image;
mod irradiance;
mod map;
mod multiple;
mod octahedral;
mod resample;
mod scattering;
mod sky;
mod spectrum;
mod studio;
mod suns;
mod table;
#[cfg(test)]
mod tests;

pub use detail::DetailMap;
use image::EnvironmentImage;
pub use irradiance::IrradianceHarmonics;
pub use map::{MAX_MAP_PIXELS, MapError, RadianceMap};
pub use sky::{ClearSky, SkySettings, sky_direction};
pub use studio::studio;
pub use suns::{MapSun, take_suns};
pub use table::{EnvironmentTable, TableArrays};
pub(crate) use table::{TableSize, Texels};

/// Columns of the image: 0.7 degrees each.
pub const COLUMNS: usize = 512;

/// Rows of the image.
pub const ROWS: usize = 256;

/// Largest radiance of a component. Products with it stay finite.
const MAX_RADIANCE: f32 = 1e12;

/// Weights of linear RGB (Rec. 709) in luminance.
pub(crate) const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// The axes of an environment in the world, orthonormal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvironmentAxes {
    /// Longitude 0: the viewer's right in a studio.
    pub right: Vec3,
    /// Longitude 90 degrees: towards the viewer in a studio.
    pub back: Vec3,
    /// The zenith.
    pub up: Vec3,
}

impl EnvironmentAxes {
    /// Axes around `up` as seen by a viewer who looks along `forward` (neither needs to have unit length), turned
    /// counterclockwise by `rotation` degrees as seen from above.
    pub fn of_view(forward: DVec3, up: DVec3, rotation: f64) -> Self {
        let up = up.try_normalize().unwrap_or(DVec3::Z);
        let level = forward - forward.dot(up) * up;
        // For a view straight down, any direction will do
        let forward = level.try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        let right = forward.cross(up);
        // Turn the axes
        let angle = rotation.to_radians();
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let turned_right = cos * right + sin * forward;
        let turned_back = sin * right - cos * forward;
        Self { right: turned_right.as_vec3(), back: turned_back.as_vec3(), up: up.as_vec3() }
    }
}

impl EnvironmentAxes {
    /// The components of `world` along these axes.
    #[inline(always)]
    pub(crate) fn own(&self, world: Vec3) -> Vec3 {
        Vec3::new(world.dot(self.right), world.dot(self.back), world.dot(self.up))
    }

    /// The world direction with the components `own` along these axes, normalised.
    pub fn to_world(&self, own: Vec3) -> Vec3 {
        (own.x * self.right + own.y * self.back + own.z * self.up).normalize()
    }

    /// The world direction with the components `x`, `y` and `z` along these axes.
    #[inline(always)]
    pub(crate) fn world(&self, x: f32, y: f32, z: f32) -> [f32; 3] {
        let Self { right, back, up } = self;
        [
            x * right.x + y * back.x + z * up.x,
            x * right.y + y * back.y + z * up.y,
            x * right.z + y * back.z + z * up.z,
        ]
    }
}

/// An environment, see the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    axes: EnvironmentAxes,
    image: EnvironmentImage,
    table: EnvironmentTable,
    /// The image at its own resolution, with a factor on its radiance.
    detail: Option<(Arc<DetailMap>, Vec3)>,
}

/// A direction sampled from an environment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvironmentSample {
    /// Unit vector towards the environment.
    pub direction: Vec3,
    /// Radiance from that direction, linear RGB.
    pub radiance: Vec3,
    /// Probability density, per steradian.
    pub pdf: f32,
}

impl Environment {
    /// The same `radiance` in every direction.
    pub fn constant(radiance: Vec3) -> Self {
        let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
        let pixels = std::iter::repeat_n(radiance, COLUMNS * ROWS);
        Self::smooth(axes, EnvironmentImage::new(pixels))
    }

    /// An environment with the radiance `of` each direction in its own axes (x right, y back, z up). Lights of less
    /// than a degree lose their shape.
    pub fn from_fn(axes: EnvironmentAxes, of: impl Fn(Vec3) -> Vec3) -> Self {
        Self::smooth(axes, EnvironmentImage::from_fn(of))
    }

    /// An environment of `map`, times `scale` per component. The centre of the map is in front.
    pub fn from_map(axes: EnvironmentAxes, map: &RadianceMap, scale: Vec3) -> Self {
        // The columns of the image begin at the right, those of the map behind the viewer
        let quarter = COLUMNS / 4;
        let resized = map.resized(COLUMNS, ROWS);
        let pixels = (0..COLUMNS * ROWS).map(|pixel| {
            let (row, column) = (pixel / COLUMNS, pixel % COLUMNS);
            scale * resized[row * COLUMNS + (column + 3 * quarter) % COLUMNS]
        });
        let image = EnvironmentImage::new(pixels);
        Self { axes, table: EnvironmentTable::fine(axes, &image), image, detail: None }
    }

    /// The same, which the camera, mirrors and clear bodies see as in `detail`, times `scale` per component.
    #[must_use]
    pub fn with_detail(self, detail: Option<Arc<DetailMap>>, scale: Vec3) -> Self {
        Self { detail: detail.map(|detail| (detail, scale)), ..self }
    }

    /// The same around other axes.
    #[must_use]
    pub fn with_axes(self, axes: EnvironmentAxes) -> Self {
        Self { axes, table: self.table.with_axes(axes), ..self }
    }

    /// The image at its own resolution, with a factor on its radiance, if it has one.
    pub const fn detail(&self) -> Option<&(Arc<DetailMap>, Vec3)> {
        self.detail.as_ref()
    }

    /// An environment without small lights.
    fn smooth(axes: EnvironmentAxes, image: EnvironmentImage) -> Self {
        Self { axes, table: EnvironmentTable::coarse(axes, &image), image, detail: None }
    }

    /// Whether no light comes from anywhere.
    pub fn is_black(&self) -> bool {
        self.image.is_black()
    }

    /// Memory, bytes.
    pub fn byte_len(&self) -> u64 {
        let detail = self.detail.as_ref().map_or(0, |(detail, _)| detail.byte_len());
        self.image.byte_len() + self.table.byte_len() + detail
    }

    /// The axes in the world.
    pub const fn axes(&self) -> &EnvironmentAxes {
        &self.axes
    }

    /// Radiance (linear RGB) of [`COLUMNS`] x [`ROWS`] directions, row by row from the zenith, in the axes of the
    /// environment.
    pub fn pixels(&self) -> &[[f32; 3]] {
        self.image.pixels()
    }

    /// The table to sample directions from.
    pub const fn table(&self) -> &EnvironmentTable {
        &self.table
    }

    /// The radiance from unit `direction` in the image, linear RGB: what a mirror shows.
    #[inline(always)]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let own = self.axes.own(direction);
        match &self.detail {
            Some((detail, scale)) => *scale * detail.radiance(own),
            None => self.image.radiance(own),
        }
    }

    /// Irradiance on a surface with unit `normal`, linear RGB.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        let own = self.axes.own(normal);
        self.image.integral(|direction| direction.dot(own).max(0.0))
    }
}
