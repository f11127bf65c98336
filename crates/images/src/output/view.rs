//! The view transform, from linear scene light to 8-bit sRGB: highlights brighter than white, the sRGB transfer
//! function, and dithering.
//!
//! Colours whose brightest component is at most 1 do not change, so that a white background is white and the colours
//! of a colour map match its legend. A shoulder below 1, as in filmic tone mappers, would compress them and turn white
//! into grey (243 of 255 with a knee at 0.8). Brighter colours follow the hue-preserving part of the Khronos PBR
//! Neutral tone mapper (2024): all components are scaled so that the brightest becomes 1, and brighter colours lose
//! more saturation. A highlight on a coloured sphere therefore still has a gradient and ends in white. Shades of grey
//! above 1 become white.

use glam::Vec3;

use crate::math::functions::pow;
use crate::math::lane_kernel;

/// Rate at which highlights fade to white with the amount of light above 1; the value of the Khronos tone mapper.
const DESATURATION: f32 = 0.15;

/// Converts linear scene light to linear display light in 0 to 1.
pub fn view_transform(color: Vec3) -> Vec3 {
    // Replace NaN by 0, and negative light, which a display cannot show
    let color = Vec3::select(color.is_nan_mask(), Vec3::ZERO, color)
        .clamp(Vec3::ZERO, Vec3::splat(f32::MAX));
    let peak = color.max_element();
    if peak <= 1.0 {
        return color;
    }
    let white = 1.0 - 1.0 / (DESATURATION * (peak - 1.0) + 1.0);
    (color / peak).lerp(Vec3::ONE, white)
}

/// The sRGB transfer function (IEC 61966-2-1) for linear light in 0 to 1.
#[inline(always)]
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * pow(linear, 1.0 / 2.4) - 0.055 }
}

/// The 8-bit sRGB value of linear light, with a rounding threshold for dithering: fractions of at least
/// `1 - threshold` are rounded up, so 0.5 rounds to nearest. Light that is exactly an 8-bit value keeps this value with
/// every threshold between 1/512 and 511/512.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "in 0 to 255 after clamping; NaN becomes 0"
)]
pub fn byte_from_linear(linear: f32, threshold: f32) -> u8 {
    (srgb_from_linear(linear.clamp(0.0, 1.0)) * 255.0 + threshold) as u8
}

lane_kernel! {
    /// [`byte_from_linear`] for many values at once; all slices have the same length.
    pub(super) fn bytes_from_linear(linear: &[f32], thresholds: &[f32], bytes: &mut [u8]) = bytes_body;
}

#[inline(always)]
fn bytes_body(linear: &[f32], thresholds: &[f32], bytes: &mut [u8]) {
    for ((byte, linear), threshold) in bytes.iter_mut().zip(linear).zip(thresholds) {
        *byte = byte_from_linear(*linear, *threshold);
    }
}

/// The rounding threshold of the pixel in column `x` and row `y`, from 1/512 to 511/512. It dithers 8-bit images, so
/// that gradients have no bands.
///
/// The fractional parts of `x / p + y / p^2`, with the plastic number `p`, fill the interval evenly over small groups
/// of neighbouring pixels, similar to blue noise but without a table (Roberts, "The unreasonable effectiveness of
/// quasirandom sequences", 2018). A triangle wave removes the jump from 1 to 0. All arithmetic is on integers, so the
/// images are the same on every machine.
pub fn dither_threshold(x: u32, y: u32) -> f32 {
    /// `2^32 / p` and `2^32 / p^2`.
    const STEPS: [u32; 2] = [3_242_174_889, 2_447_445_414];
    let sawtooth = x.wrapping_mul(STEPS[0]).wrapping_add(y.wrapping_mul(STEPS[1]));
    let is_falling = sawtooth >> 31 == 1;
    let triangle = (if is_falling { !sawtooth } else { sawtooth }) << 1;
    ((triangle >> 24) as f32 + 0.5) / 256.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{SimdLevel, Supported};

    #[test]
    fn colours_within_the_display_range_do_not_change() {
        for color in [
            Vec3::ZERO,
            Vec3::splat(0.18),
            Vec3::new(0.8, 0.1, 0.0),
            Vec3::new(0.02, 1.0, 0.7),
            Vec3::ONE,
        ] {
            assert_eq!(view_transform(color), color);
        }
        assert_eq!(byte_from_linear(0.18, 0.5), 118);
        // The linear segment of sRGB: 0.002 * 12.92 * 255 = 6.59
        assert_eq!(byte_from_linear(0.002, 0.5), 7);
        assert_eq!(byte_from_linear(0.002, 0.25), 6);
    }

    #[test]
    fn white_is_white_and_exact_bytes_keep_their_value_at_every_threshold() {
        let linear_from_byte = |byte: u8| {
            let value = f64::from(byte) / 255.0;
            let linear =
                if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
            #[expect(clippy::cast_possible_truncation, reason = "a value in 0 to 1")]
            let linear = linear as f32;
            linear
        };
        for step in 0..256_u16 {
            let threshold = (f32::from(step) + 0.5) / 256.0;
            for byte in 0..=255 {
                let linear = view_transform(Vec3::splat(linear_from_byte(byte))).x;
                assert_eq!(byte_from_linear(linear, threshold), byte, "{threshold}");
            }
        }
    }

    #[test]
    fn conversion_in_lanes_equals_single_conversion() {
        let linear: Vec<f32> = (0..5000_u16).map(|i| f32::from(i) / 4900.0 - 0.01).collect();
        let thresholds: Vec<f32> = (0..5000).map(|i| dither_threshold(i, i / 7)).collect();
        let expected: Vec<u8> =
            linear.iter().zip(&thresholds).map(|(l, t)| byte_from_linear(*l, *t)).collect();
        for level in SimdLevel::ALL {
            let mut bytes = vec![7; linear.len()];
            bytes_from_linear(Supported::or_best(level), &linear, &thresholds, &mut bytes);
            assert!(bytes == expected, "{level:?}");
        }
    }

    #[test]
    fn dithering_keeps_the_mean_of_few_neighbours() {
        let side = 16;
        for (left, top) in [(0, 0), (1000, 3), (65_520, 65_520)] {
            for (level, expected) in [(0.25, 100.25), (0.5, 100.5), (0.9, 100.9)] {
                let mut sum = 0.0;
                for (x, y) in (0..side * side).map(|i| (left + i % side, top + i / side)) {
                    let threshold = dither_threshold(x, y);
                    assert!((1.0 / 512.0..=511.0 / 512.0).contains(&threshold));
                    sum += (100.0 + level + threshold).floor();
                }
                let mean = sum / (side * side) as f32;
                assert!((mean - expected).abs() < 0.02, "{left} {top} {level}: {mean}");
            }
        }
    }

    #[test]
    fn highlights_keep_their_hue_and_end_white() {
        // There is no jump at 1
        let below = view_transform(Vec3::new(1.0, 0.5, 0.25));
        let above = view_transform(Vec3::new(1.001, 0.5005, 0.250_25));
        assert!((above - below).abs().max_element() < 1e-3);
        let mild = view_transform(Vec3::new(2.0, 1.0, 0.5));
        let bright = view_transform(Vec3::new(100.0, 50.0, 25.0));
        assert!(mild.x == 1.0 && bright.x == 1.0);
        assert!(mild.z < 0.4 && bright.z > 0.8);
        let mut last = 0.0;
        for step in 0..200_u8 {
            let next = view_transform(Vec3::new(1.0, 0.5, 0.25) * f32::from(step)).z;
            assert!(next > last || step == 0, "{step}");
            last = next;
        }
        let wild = Vec3::new(f32::NAN, f32::INFINITY, -3.0);
        assert!(view_transform(wild).is_finite());
    }
}
