//! The environment: light from infinitely far away, from every direction.
//!
//! Every kind of environment fills the same table: radiance in latitude and longitude, with a distribution to sample
//! directions in proportion to it. Radiance is bilinear between the centres of texels, and the probability density is
//! constant in a texel. The density follows the luminance of a texel and its neighbours, so that it is positive
//! wherever bilinear radiance is (Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, 12.5).
//!
//! All functions of a direction are free of calls, so that loops over lanes can use them; they return the same bits
//! on every platform.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{DVec3, Vec3};

use spherule_tree::math::functions::{acos, atan2, sin_cos};

mod distribution;
mod irradiance;
mod map;
mod sky;
mod studio;
#[cfg(test)]
mod tests;

use distribution::{Cell, Distribution};
pub use irradiance::IrradianceHarmonics;
pub use map::{MAX_MAP_PIXELS, MapError, RadianceMap};
pub use sky::{sky, sky_direction};
pub use studio::studio;

/// Columns of the table: 0.7 degrees each.
pub const COLUMNS: usize = 512;

/// Rows of the table.
pub const ROWS: usize = 256;

/// Least density of a texel, as a fraction of the density of uniform sampling.
const LEAST_DENSITY: f64 = 1e-4;

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
    fn own(&self, world: Vec3) -> Vec3 {
        Vec3::new(world.dot(self.right), world.dot(self.back), world.dot(self.up))
    }

    /// The world direction with the components `own` along these axes, normalised.
    pub fn to_world(&self, own: Vec3) -> Vec3 {
        (own.x * self.right + own.y * self.back + own.z * self.up).normalize()
    }
}

/// An environment, see the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    axes: EnvironmentAxes,
    /// Radiance (linear RGB) and probability density (per steradian) of each texel, row by row from the zenith.
    texels: Vec<[f32; 4]>,
    /// Cosine of the polar angle at the upper edge of each row, and at the nadir.
    cosines: Vec<f32>,
    distribution: Distribution,
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
        Self::from_texels(axes, vec![radiance; COLUMNS * ROWS])
    }

    /// An environment with the radiance `of` each direction in its own axes (x right, y back, z up): the mean over
    /// four points of a texel.
    pub fn from_fn(axes: EnvironmentAxes, of: impl Fn(Vec3) -> Vec3) -> Self {
        let texel = |row: usize, column: usize| {
            let points = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
            let sum: Vec3 = points
                .map(|(across, down)| of(own_direction(column, row, across, down)))
                .iter()
                .sum();
            0.25 * sum
        };
        let texels = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
        let texels = texels.map(|(row, column)| texel(row, column)).collect();
        Self::from_texels(axes, texels)
    }

    /// An environment of `map`, times `scale` per component. The centre of the map is in front.
    pub fn from_map(axes: EnvironmentAxes, map: &RadianceMap, scale: Vec3) -> Self {
        // The columns of the table begin at the right, those of the map behind the viewer
        let quarter = COLUMNS / 4;
        let resized = map.resized(COLUMNS, ROWS);
        let texels = (0..COLUMNS * ROWS).map(|texel| {
            let (row, column) = (texel / COLUMNS, texel % COLUMNS);
            scale * resized[row * COLUMNS + (column + 3 * quarter) % COLUMNS]
        });
        Self::from_texels(axes, texels.collect())
    }

    fn from_texels(axes: EnvironmentAxes, radiance: Vec<Vec3>) -> Self {
        // Bound the radiance; NaN becomes 0
        let bounded = |v: f32| if v > 0.0 { v.min(MAX_RADIANCE) } else { 0.0 };
        let radiance: Vec<Vec3> = radiance.into_iter().map(|rgb| rgb.map(bounded)).collect();
        // Weight each texel by its luminance and solid angle
        let cosines: Vec<f64> = (0..=ROWS).map(edge_cosine).collect();
        let solid_angle = |row: usize| {
            2.0 * std::f64::consts::PI / COLUMNS as f64 * (cosines[row] - cosines[row + 1])
        };
        let mut weights = smoothed_luminance(&radiance);
        let rows = || weights.chunks(COLUMNS).enumerate();
        let total: f64 =
            rows().map(|(row, weights)| weights.iter().sum::<f64>() * solid_angle(row)).sum();
        let mean = total / (4.0 * std::f64::consts::PI);
        let least = if mean > 0.0 { LEAST_DENSITY * mean } else { 1.0 };
        for (row, weights) in weights.chunks_mut(COLUMNS).enumerate() {
            for weight in weights {
                *weight = (*weight + least) * solid_angle(row);
            }
        }
        // Store the density of the distribution as it is sampled
        let distribution = Distribution::new(COLUMNS, &weights);
        let texels = radiance.iter().enumerate().map(|(texel, radiance)| {
            let (row, column) = (texel / COLUMNS, texel % COLUMNS);
            let pdf = distribution.probability(column, row) / solid_angle(row);
            let [r, g, b] = radiance.to_array();
            [r, g, b, narrow(pdf)]
        });
        Self {
            axes,
            texels: texels.collect(),
            cosines: cosines.iter().map(|cosine| narrow(*cosine)).collect(),
            distribution,
        }
    }

    /// Whether no light comes from anywhere.
    pub fn is_black(&self) -> bool {
        self.texels.iter().all(|[r, g, b, _]| *r == 0.0 && *g == 0.0 && *b == 0.0)
    }

    /// Memory, bytes.
    pub fn byte_len(&self) -> u64 {
        let own = size_of_val(&*self.texels) + size_of_val(&*self.cosines);
        own as u64 + self.distribution.byte_len()
    }

    /// The radiance from unit `direction`, linear RGB.
    #[inline(always)]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let [x, y] = self.texel_at(direction);
        self.bilinear(x, y)
    }

    /// The probability density of [`Self::sample`] at unit `direction`, per steradian.
    #[inline(always)]
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let [x, y] = self.texel_at(direction);
        self.texels[index(y, ROWS) * COLUMNS + index(x, COLUMNS)][3]
    }

    /// Radiance and probability density in one call.
    #[inline(always)]
    pub fn radiance_and_pdf(&self, direction: Vec3) -> (Vec3, f32) {
        let [x, y] = self.texel_at(direction);
        let pdf = self.texels[index(y, ROWS) * COLUMNS + index(x, COLUMNS)][3];
        (self.bilinear(x, y), pdf)
    }

    /// Samples a direction. The components of `u` are in 0..1.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> EnvironmentSample {
        let cell = self.distribution.sample(u);
        let (direction, z) = self.direction_in(&cell);
        let x = cell.column as f32 + cell.across;
        EnvironmentSample {
            direction,
            radiance: self.bilinear(x, acos(z) * (FRAC_1_PI * ROWS as f32)),
            pdf: self.texels[cell.row * COLUMNS + cell.column][3],
        }
    }

    /// The direction of [`Self::sample`] alone, which takes less time.
    #[inline(always)]
    pub fn sample_direction(&self, u: [f32; 2]) -> Vec3 {
        self.direction_in(&self.distribution.sample(u)).0
    }

    /// The direction of a point in a texel, uniform in solid angle, and its cosine with the zenith.
    #[inline(always)]
    fn direction_in(&self, cell: &Cell) -> (Vec3, f32) {
        let [top, bottom] = [self.cosines[cell.row], self.cosines[cell.row + 1]];
        let z = top + (bottom - top) * cell.down;
        let rest = (1.0 - z) * (1.0 + z);
        let level = (if rest > 0.0 { rest } else { 0.0 }).sqrt();
        let x = cell.column as f32 + cell.across;
        let (sin, cos) = sin_cos(x * (2.0 * PI / COLUMNS as f32));
        let axes = &self.axes;
        let direction = level * cos * axes.right + level * sin * axes.back + z * axes.up;
        (direction, z)
    }

    /// Irradiance on a surface with unit `normal`, linear RGB.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        integral(&self.lit_texels(normal), |texel| *texel)
    }

    /// The integral of the radiance over all directions, linear RGB.
    pub fn flux(&self) -> Vec3 {
        integral(&self.texels, |[r, g, b, _]| Vec3::new(*r, *g, *b))
    }

    /// This environment times the cosine between its directions and a unit `normal`, 0 behind it: sampling it samples
    /// irradiance.
    #[must_use]
    pub fn times_cosine(&self, normal: Vec3) -> Self {
        Self::from_texels(self.axes, self.lit_texels(normal))
    }

    /// The radiance of each texel times the cosine between its centre and a unit `normal`, 0 behind it.
    fn lit_texels(&self, normal: Vec3) -> Vec<Vec3> {
        let own = self.axes.own(normal);
        self.weighted_texels(|direction| direction.dot(own).max(0.0))
    }

    /// The radiance of each texel times a weight of the direction of its centre, in the axes of the environment.
    fn weighted_texels(&self, weight: impl Fn(Vec3) -> f32) -> Vec<Vec3> {
        let weight = &weight;
        let longitudes: Vec<[f64; 2]> = (0..COLUMNS).map(|x| longitude(x, 0.5)).collect();
        let rows = self.texels.chunks(COLUMNS).enumerate();
        let lit = rows.flat_map(|(row, texels)| {
            let polar = polar(row, 0.5);
            texels.iter().zip(&longitudes).map(move |([r, g, b, _], longitude)| {
                weight(direction_at(polar, *longitude)) * Vec3::new(*r, *g, *b)
            })
        });
        lit.collect()
    }

    /// The position of `direction` in the table, in columns and rows.
    #[inline(always)]
    fn texel_at(&self, direction: Vec3) -> [f32; 2] {
        let axes = &self.axes;
        let z = direction.dot(axes.up);
        let z = if z > -1.0 { z } else { -1.0 };
        let z = if z < 1.0 { z } else { 1.0 };
        let longitude = atan2(direction.dot(axes.back), direction.dot(axes.right));
        let turns = longitude * (0.5 * FRAC_1_PI);
        let turns = if turns < 0.0 { turns + 1.0 } else { turns };
        [turns * COLUMNS as f32, acos(z) * (FRAC_1_PI * ROWS as f32)]
    }

    /// Radiance at a position in the table, bilinear between the centres of texels.
    #[inline(always)]
    fn bilinear(&self, x: f32, y: f32) -> Vec3 {
        // Shift by one texel to keep positions positive
        let (x, y) = (x + 0.5, y + 0.5);
        let (column, row) = (index(x, COLUMNS + 1), index(y, ROWS + 1));
        let (across, down) = (x - column as f32, y - row as f32);
        let (left, right) = ((column + COLUMNS - 1) % COLUMNS, column % COLUMNS);
        let (above, below) = (row.saturating_sub(1), if row < ROWS { row } else { ROWS - 1 });
        let texel = |row: usize, column: usize| {
            let [r, g, b, _] = self.texels[row * COLUMNS + column];
            Vec3::new(r, g, b)
        };
        let above = texel(above, left) * (1.0 - across) + texel(above, right) * across;
        let below = texel(below, left) * (1.0 - across) + texel(below, right) * across;
        above * (1.0 - down) + below * down
    }
}

/// The cell of `0..count` that contains `position`; the nearest one for positions outside, the first for NaN.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn index(position: f32, count: usize) -> usize {
    let cell = position as usize;
    if cell < count { cell } else { count - 1 }
}

/// The integral of the `value` of texels over the sphere.
fn integral<T>(texels: &[T], value: impl Fn(&T) -> Vec3) -> Vec3 {
    let mut sum = DVec3::ZERO;
    for (row, texels) in texels.chunks(COLUMNS).enumerate() {
        let height = edge_cosine(row) - edge_cosine(row + 1);
        let of_row: DVec3 = texels.iter().map(|texel| value(texel).as_dvec3()).sum();
        sum += height * of_row;
    }
    (sum * (2.0 * std::f64::consts::PI / COLUMNS as f64)).as_vec3()
}

/// The direction of a point of a texel, in the axes of the environment.
fn own_direction(column: usize, row: usize, across: f64, down: f64) -> Vec3 {
    direction_at(polar(row, down), longitude(column, across))
}

/// Sine and cosine of the polar angle at a height in `row`.
fn polar(row: usize, down: f64) -> [f64; 2] {
    let polar = (row as f64 + down) * std::f64::consts::PI / ROWS as f64;
    [libm::sin(polar), libm::cos(polar)]
}

/// Sine and cosine of the longitude at a position in `column`.
fn longitude(column: usize, across: f64) -> [f64; 2] {
    let longitude = (column as f64 + across) * 2.0 * std::f64::consts::PI / COLUMNS as f64;
    [libm::sin(longitude), libm::cos(longitude)]
}

/// The direction of a polar angle and a longitude, given by their sines and cosines.
fn direction_at([level, z]: [f64; 2], [sin, cos]: [f64; 2]) -> Vec3 {
    DVec3::new(level * cos, level * sin, z).as_vec3()
}

/// Cosine of the polar angle at the upper edge of `row`.
fn edge_cosine(row: usize) -> f64 {
    libm::cos(row as f64 * std::f64::consts::PI / ROWS as f64)
}

/// Luminance, averaged over each texel and its eight neighbours.
fn smoothed_luminance(radiance: &[Vec3]) -> Vec<f64> {
    let of = |row: usize, column: usize| -> f64 {
        f64::from(radiance[row * COLUMNS + column].dot(LUMINANCE))
    };
    let mut smoothed = Vec::with_capacity(radiance.len());
    for row in 0..ROWS {
        let rows = [row.saturating_sub(1), row, (row + 1).min(ROWS - 1)];
        for column in 0..COLUMNS {
            let columns = [(column + COLUMNS - 1) % COLUMNS, column, (column + 1) % COLUMNS];
            let sum: f64 = rows
                .iter()
                .map(|row| columns.iter().map(|column| of(*row, *column)).sum::<f64>())
                .sum();
            smoothed.push(sum / 9.0);
        }
    }
    smoothed
}

#[expect(clippy::cast_possible_truncation, reason = "tables are f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}
