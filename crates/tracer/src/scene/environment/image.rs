//! The picture of an environment in latitude and longitude: what mirrors and the camera see. It is bilinear between
//! the centres of its pixels.

use std::f32::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};

use super::{COLUMNS, MAX_RADIANCE, ROWS};
use spherule_tree::math::functions::{acos, atan2};

/// Radiance (linear RGB) of [`COLUMNS`] x [`ROWS`] directions, row by row from the zenith, in the axes of an
/// environment (x right, y back, z up).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EnvironmentImage {
    pixels: Vec<[f32; 3]>,
}

impl EnvironmentImage {
    /// An image with these pixels. Their radiance is bounded; NaN counts as 0.
    pub(super) fn new(radiance: impl Iterator<Item = Vec3>) -> Self {
        let bounded = |v: f32| if v > 0.0 { v.min(MAX_RADIANCE) } else { 0.0 };
        let pixels: Vec<_> = radiance.map(|rgb| rgb.to_array().map(bounded)).collect();
        assert_eq!(pixels.len(), COLUMNS * ROWS, "one value per pixel");
        Self { pixels }
    }

    /// The image of a function of the direction: the mean over four points of a pixel.
    pub(super) fn from_fn(of: impl Fn(Vec3) -> Vec3) -> Self {
        // All rows have the same longitudes
        let longitudes: Vec<[[f64; 2]; 2]> = (0..COLUMNS)
            .map(|x| [longitude(x, 0.25, COLUMNS), longitude(x, 0.75, COLUMNS)])
            .collect();
        let mut pixels = Vec::with_capacity(COLUMNS * ROWS);
        for row in 0..ROWS {
            let [above, below] = [polar(row, 0.25, ROWS), polar(row, 0.75, ROWS)];
            for [left, right] in &longitudes {
                let [a, b] = [left, right].map(|at| direction_at(above, *at).as_vec3());
                let [c, d] = [left, right].map(|at| direction_at(below, *at).as_vec3());
                pixels.push(0.25 * (of(a) + of(b) + of(c) + of(d)));
            }
        }
        Self::new(pixels.into_iter())
    }

    /// All pixels, row by row.
    pub(super) fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// The pixels of each row, from the zenith.
    pub(super) fn rows(&self) -> impl Iterator<Item = &[[f32; 3]]> {
        self.pixels.chunks(COLUMNS)
    }

    /// Whether no light comes from anywhere.
    pub(super) fn is_black(&self) -> bool {
        self.pixels.iter().all(|rgb| *rgb == [0.0; 3])
    }

    /// Memory, bytes.
    pub(super) fn byte_len(&self) -> u64 {
        size_of_val(&*self.pixels) as u64
    }

    /// The radiance from a unit vector, linear RGB.
    #[inline(always)]
    pub(super) fn radiance(&self, own: Vec3) -> Vec3 {
        let z = if own.z > -1.0 { own.z } else { -1.0 };
        let z = if z < 1.0 { z } else { 1.0 };
        let turns = atan2(own.y, own.x) * (0.5 * FRAC_1_PI);
        let turns = if turns < 0.0 { turns + 1.0 } else { turns };
        self.bilinear(turns * COLUMNS as f32, acos(z) * (FRAC_1_PI * ROWS as f32))
    }

    /// Radiance at a position in columns and rows, bilinear between the centres of pixels.
    #[inline(always)]
    fn bilinear(&self, x: f32, y: f32) -> Vec3 {
        // Shift by one pixel to keep positions positive
        let (x, y) = (x + 0.5, y + 0.5);
        let (column, row) = (index(x, COLUMNS + 1), index(y, ROWS + 1));
        let (across, down) = (x - column as f32, y - row as f32);
        let (left, right) = ((column + COLUMNS - 1) % COLUMNS, column % COLUMNS);
        let (above, below) = (row.saturating_sub(1), if row < ROWS { row } else { ROWS - 1 });
        let pixel =
            |row: usize, column: usize| Vec3::from_array(self.pixels[row * COLUMNS + column]);
        let above = pixel(above, left) * (1.0 - across) + pixel(above, right) * across;
        let below = pixel(below, left) * (1.0 - across) + pixel(below, right) * across;
        above * (1.0 - down) + below * down
    }

    /// The integral over all directions of the radiance times a `weight` of the direction of each pixel's centre.
    pub(super) fn integral(&self, weight: impl Fn(Vec3) -> f32) -> Vec3 {
        let longitudes: Vec<[f64; 2]> = (0..COLUMNS).map(|x| longitude(x, 0.5, COLUMNS)).collect();
        let mut sum = DVec3::ZERO;
        for (row, pixels) in self.rows().enumerate() {
            let height = edge_cosine(row, ROWS) - edge_cosine(row + 1, ROWS);
            let polar = polar(row, 0.5, ROWS);
            let terms = pixels.iter().zip(&longitudes).map(|(rgb, longitude)| {
                let weighted =
                    weight(direction_at(polar, *longitude).as_vec3()) * Vec3::from_array(*rgb);
                weighted.as_dvec3()
            });
            sum += height * terms.sum::<DVec3>();
        }
        (sum * (2.0 * std::f64::consts::PI / COLUMNS as f64)).as_vec3()
    }
}

/// The cell of `0..count` that contains `position`; the nearest one for positions outside, the first for NaN.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn index(position: f32, count: usize) -> usize {
    let cell = position as usize;
    if cell < count { cell } else { count - 1 }
}

/// Sine and cosine of the polar angle at a height in `row`, of `rows` rows.
pub(super) fn polar(row: usize, down: f64, rows: usize) -> [f64; 2] {
    let polar = (row as f64 + down) * std::f64::consts::PI / rows as f64;
    [libm::sin(polar), libm::cos(polar)]
}

/// Sine and cosine of the longitude at a position in `column`, of `columns` columns.
pub(super) fn longitude(column: usize, across: f64, columns: usize) -> [f64; 2] {
    let longitude = (column as f64 + across) * 2.0 * std::f64::consts::PI / columns as f64;
    [libm::sin(longitude), libm::cos(longitude)]
}

/// The direction of a polar angle and a longitude, given by their sines and cosines.
pub(super) fn direction_at([level, z]: [f64; 2], [sin, cos]: [f64; 2]) -> DVec3 {
    DVec3::new(level * cos, level * sin, z)
}

/// Cosine of the polar angle at the upper edge of a row, of `rows` rows.
pub(super) fn edge_cosine(row: usize, rows: usize) -> f64 {
    libm::cos(row as f64 * std::f64::consts::PI / rows as f64)
}
