//! An image of the environment at its own resolution: what the camera, mirrors and clear bodies see.

use glam::Vec3;
use half::f16;
use half::slice::HalfFloatSliceExt;
use spherule_tree::math::functions::{acos, atan2};

use super::COLUMNS;
use super::map::RadianceMap;

/// Radiance by direction, as in a [`RadianceMap`], in half floats: larger radiances than 65504 are that.
#[derive(Debug, Clone, PartialEq)]
pub struct DetailMap {
    width: usize,
    height: usize,
    pixels: Vec<[f16; 3]>,
}

impl DetailMap {
    /// The pixels of `map`; None if it has no more than environments have.
    pub fn of(map: &RadianceMap) -> Option<Self> {
        (map.size()[0] > COLUMNS).then(|| Self::new(map))
    }

    fn new(map: &RadianceMap) -> Self {
        let [width, height] = map.size();
        let largest = Vec3::splat(f16::MAX.to_f32());
        let half = |rgb: &Vec3| rgb.min(largest).to_array().map(f16::from_f32);
        Self { width, height, pixels: map.pixels().iter().map(half).collect() }
    }

    /// Width and height in pixels.
    pub const fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The bits of the half floats, three a pixel, row by row from the zenith. The middle column is in front.
    pub fn bits(&self) -> &[u16] {
        self.pixels.as_flattened().reinterpret_cast()
    }

    /// Memory, bytes.
    pub fn byte_len(&self) -> u64 {
        size_of_val(&*self.pixels) as u64
    }

    /// Radiance from a unit vector in the axes of an environment, bilinear between the centres of pixels.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    pub(super) fn radiance(&self, own: Vec3) -> Vec3 {
        // The middle column is in front, where the angle is three quarters of a turn
        let turns = atan2(own.y, own.x) / std::f32::consts::TAU + 0.75;
        let x = (turns - turns.floor()) * self.width as f32 + (self.width as f32 - 0.5);
        let y = acos(own.z.clamp(-1.0, 1.0)) / std::f32::consts::PI * self.height as f32 - 0.5;
        let (left, above) = (x.floor(), y.floor());
        let (across, down) = (x - left, y - above);
        let last = self.height as i32 - 1;
        let pixel = |down: i32, right: usize| {
            let row = (above as i32 + down).clamp(0, last) as usize;
            let column = (left as usize + right) % self.width;
            Vec3::from_array(self.pixels[row * self.width + column].map(f16::to_f32))
        };
        let row = |down| pixel(down, 0) * (1.0 - across) + pixel(down, 1) * across;
        row(0) * (1.0 - down) + row(1) * down
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::environment::{Environment, EnvironmentAxes, ROWS};

    /// At the resolution of environments, the detail is the image.
    #[test]
    fn directions_are_those_of_the_image() {
        let pixel = |i: usize| Vec3::new((i % 512) as f32, (i / 512) as f32, 1.0) / 256.0;
        let pixels = (0..COLUMNS * ROWS).map(pixel).collect();
        let map = RadianceMap::new(COLUMNS, ROWS, pixels).unwrap();
        let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
        let environment = Environment::from_map(axes, &map, Vec3::ONE);
        let detail = DetailMap::new(&map);
        for i in 0..2000_u16 {
            let z = f32::from(i).mul_add(-0.001, 1.0);
            let (sin, cos) = (f32::from(i) * 0.37).sin_cos();
            let own = Vec3::new(cos, sin, 0.0) * (1.0 - z * z).max(0.0).sqrt() + z * Vec3::Z;
            let [a, b] = [environment.radiance(axes.to_world(own)), detail.radiance(own)];
            assert!((a - b).abs().max_element() < 0.02, "{own}: {a} {b}");
        }
    }

    #[test]
    fn pixels_are_seen_at_their_own_resolution() {
        let white = |i: usize| if i.is_multiple_of(2) { Vec3::ONE } else { Vec3::ZERO };
        let map = RadianceMap::new(4096, 2048, (0..4096 * 2048).map(white).collect()).unwrap();
        let detail = DetailMap::new(&map);
        let seen = |column: f64| {
            let angle = ((column + 0.5) / 4096.0 + 0.25) * std::f64::consts::TAU;
            detail.radiance(DVec3::new(angle.cos(), angle.sin(), 0.0).as_vec3()).x
        };
        assert!(seen(100.0) > 0.95 && seen(101.0) < 0.05, "{} {}", seen(100.0), seen(101.0));
        assert!((seen(100.5) - 0.5).abs() < 0.05);
    }
}
