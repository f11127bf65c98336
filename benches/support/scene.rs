//! The thesis's experiment: the filled box, the still camera and the order of the pixels.

use glam::Vec3;
use spherule::ray::{PACKET_SIZE, Ray};
use spherule_formats::generate::{BoxSettings, fill_box};

/// Image size in pixels.
const WIDTH: u16 = 1920;
const HEIGHT: u16 = 1080;
/// Pixels along a side of the tiles in which the image is traced.
pub(crate) const TILE_SIDE: usize = 16;
/// Side of a square of pixels whose rays go as a packet.
const SQUARE_SIDE: usize = 4;
/// Volume of the thesis's box.
const BOX_VOLUME: f32 = 48.0;
/// Every machine measures the same particles.
const SEED: u64 = 1;

/// Spheres of one radius in the box, and what looks at them.
#[derive(Debug)]
pub(crate) struct Scene {
    /// Particle positions.
    pub(crate) centers: Vec<Vec3>,
    /// Half the mean spacing, so that the box looks filled at any count.
    pub(crate) radius: f32,
    /// Makes the primary rays.
    pub(crate) camera: Camera,
    /// All pixels as x and y, tile after tile, each in squares of [`PACKET_SIZE`].
    pub(crate) pixels: Vec<[u16; 2]>,
}

impl Scene {
    /// The box with `count` particles.
    pub(crate) fn thesis(count: usize) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a radius needs no more digits")]
        let spacing = (BOX_VOLUME / count as f32).cbrt();
        Self {
            centers: fill_box(&BoxSettings::thesis(count, SEED)),
            radius: 0.5 * spacing,
            camera: Camera::thesis(),
            pixels: pixels_by_tile(),
        }
    }
}

/// A pinhole at the origin.
#[derive(Debug)]
pub(crate) struct Camera {
    forward: Vec3,
    /// Half the image plane's width and height at distance 1.
    right: Vec3,
    up: Vec3,
}

impl Camera {
    /// Looks at (5, 5, 0) with z up and 45 degrees from bottom to top.
    fn thesis() -> Self {
        let forward = Vec3::new(5.0, 5.0, 0.0).normalize();
        let right = forward.cross(Vec3::Z).normalize();
        let half_height = 22.5_f32.to_radians().tan();
        let half_width = half_height * f32::from(WIDTH) / f32::from(HEIGHT);
        Self { forward, right: right * half_width, up: right.cross(forward) * half_height }
    }

    /// The ray through the middle of a pixel; row 0 is the top.
    pub(crate) fn ray(&self, [x, y]: [u16; 2]) -> Ray {
        let u = 2.0 * (f32::from(x) + 0.5) / f32::from(WIDTH) - 1.0;
        let v = 1.0 - 2.0 * (f32::from(y) + 0.5) / f32::from(HEIGHT);
        let direction = self.forward + u * self.right + v * self.up;
        Ray::new(Vec3::ZERO, direction.normalize())
    }
}

/// Tile after tile, and in a tile one square after another.
fn pixels_by_tile() -> Vec<[u16; 2]> {
    let mut pixels = Vec::with_capacity(usize::from(WIDTH) * usize::from(HEIGHT));
    let image = [0, WIDTH, 0, HEIGHT];
    for tile in parts(image, TILE_SIDE) {
        for square in parts(tile, SQUARE_SIDE) {
            let [left, right, top, bottom] = square;
            pixels.extend((top..bottom).flat_map(|y| (left..right).map(move |x| [x, y])));
        }
    }
    pixels
}

/// Cuts a rectangle (left, right, top, bottom) into squares of so many pixels.
fn parts([left, right, top, bottom]: [u16; 4], side: usize) -> Vec<[u16; 4]> {
    let side = u16::try_from(side).expect("smaller than an image");
    let mut parts = Vec::new();
    for y in (top..bottom).step_by(side.into()) {
        for x in (left..right).step_by(side.into()) {
            parts.push([x, (x + side).min(right), y, (y + side).min(bottom)]);
        }
    }
    parts
}

const _: () = assert!(SQUARE_SIDE * SQUARE_SIDE == PACKET_SIZE);
