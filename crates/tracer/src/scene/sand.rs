//! Sand as a pattern of the ground: slightly lighter and darker spots of many sizes, a sum of value noises (Perlin and
//! Hoffert, "Hypertexture", 1989).

use glam::Vec3;

use spherule_tree::math::{LANES, Lanes, Lanes3, lane_kernel, splat};

/// Greatest difference of a shade from 1.
pub(super) const CONTRAST: f32 = 0.4;

/// Number of sizes of spots; each is half of the one before.
const SIZES: u32 = 8;

/// Contrast of spots as a fraction of that of spots of twice the size.
const GAIN: f32 = 0.85;

/// Beyond this distance from the centre, in distances between spots, there are no spots.
const FAR: f32 = 4e6;

/// 1.5 * 2^23: f32 from 2^23 to 2^24 are integers, so adding it rounds to an integer, in the lowest bits.
const ROUNDING: f32 = 12_582_912.0;

/// Where the spots are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    pub(super) center: Vec3,
    /// Distance between the largest spots.
    pub(super) tile: f32,
    /// Unit directions of its rows and columns.
    pub(super) across: Vec3,
    pub(super) along: Vec3,
}

/// Factor of the colour at a place, in distances between the largest spots.
pub(super) fn shade(place: [f32; 2]) -> f32 {
    let ([mut x, mut y], mut sum, mut sizes) = (place, 0.0, Sizes::default());
    for _ in 0..SIZES {
        sum += sizes.part * value_noise(x, y);
        [x, y] = halved(x, y);
        sizes = sizes.next();
    }
    sizes.shade(sum)
}

#[inline(always)]
fn shades_body(lattice: &Lattice, points: &Lanes3, shades: &mut Lanes) {
    let (mut x, mut y) = (splat(0.0), splat(0.0));
    let (mut sum, mut sizes) = (splat(0.0), Sizes::default());
    for lane in 0..LANES {
        let point = Vec3::new(points[0][lane], points[1][lane], points[2][lane]);
        let from_middle = (point - lattice.center) / lattice.tile;
        x[lane] = from_middle.dot(lattice.across);
        y[lane] = from_middle.dot(lattice.along);
    }
    for _ in 0..SIZES {
        for lane in 0..LANES {
            sum[lane] += sizes.part * value_noise(x[lane], y[lane]);
            [x[lane], y[lane]] = halved(x[lane], y[lane]);
        }
        sizes = sizes.next();
    }
    for lane in 0..LANES {
        shades[lane] = sizes.shade(sum[lane]);
    }
}

lane_kernel! {
    /// Factors of the colour at `points`.
    pub(super) fn shades(lattice: &Lattice, points: &Lanes3, shades: &mut Lanes) = shades_body;
}

/// The place among spots of half the size. It is turned by 37 degrees, so that the lattices do not coincide.
#[inline(always)]
fn halved(x: f32, y: f32) -> [f32; 2] {
    [2.0 * (0.8 * x - 0.6 * y) + 0.37, 2.0 * (0.6 * x + 0.8 * y) + 0.71]
}

/// The contrast of spots of one size, and the sum of those of larger ones.
#[derive(Clone, Copy)]
struct Sizes {
    part: f32,
    whole: f32,
}

impl Default for Sizes {
    #[inline(always)]
    fn default() -> Self {
        let (part, whole) = (1.0, 0.0);
        Self { part, whole }
    }
}

impl Sizes {
    #[inline(always)]
    fn next(self) -> Self {
        Self { part: self.part * GAIN, whole: self.whole + self.part }
    }

    #[inline(always)]
    fn shade(self, sum: f32) -> f32 {
        1.0 + CONTRAST * (sum / self.whole)
    }
}

/// Random values from -1 to 1 at integers, interpolated smoothly.
#[inline(always)]
fn value_noise(x: f32, y: f32) -> f32 {
    let ((left, u), (below, v)) = (split(x), split(y));
    let low = row_value(left, u, below);
    let high = row_value(left, u, below.wrapping_add(1));
    low + v * (high - low)
}

/// The interpolated value on a row of integers, between those at `left` and right of it.
#[inline(always)]
fn row_value(left: u32, u: f32, row: u32) -> f32 {
    let ends = [lattice_value(left, row), lattice_value(left.wrapping_add(1), row)];
    ends[0] + u * (ends[1] - ends[0])
}

/// The largest integer not above `value`, and the smoothed rest from 0 to 1.
#[inline(always)]
fn split(value: f32) -> (u32, f32) {
    let value = value.clamp(-FAR, FAR);
    let shifted = value + ROUNDING;
    let nearest = shifted - ROUNDING;
    let is_above = nearest > value;
    let integer = shifted.to_bits().wrapping_sub(ROUNDING.to_bits()).wrapping_sub(is_above as u32);
    let rest = value - (nearest - if is_above { 1.0 } else { 0.0 });
    (integer, rest * rest * (3.0 - 2.0 * rest))
}

/// A random value from -1 to 1 for a point with integer coordinates (hash by Wellons, "lowbias32", 2018).
#[inline(always)]
fn lattice_value(x: u32, y: u32) -> f32 {
    let mut bits = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ bits >> 16).wrapping_mul(0x7feb_352d);
    bits = (bits ^ bits >> 15).wrapping_mul(0x846c_a68b);
    bits ^= bits >> 16;
    // Signed conversions are vector instructions on all machines
    (bits >> 8).cast_signed() as f32 / (1 << 23) as f32 - 1.0
}
