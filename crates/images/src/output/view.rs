//! The view transform, from linear scene light to 8-bit sRGB: exposure, highlights brighter than white, the sRGB
//! transfer function, and dithering.

use glam::{Mat3, Vec3};

use crate::math::functions::{exp2, log2, pow};
use crate::math::lane_kernel;

/// How scene light is shown on a display. Images in linear light do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DisplayView {
    /// Exposure in stops: each stop doubles the brightness.
    pub exposure: f32,
    /// How brightness and colours are reduced to those of a display.
    pub transform: ViewTransform,
}

impl DisplayView {
    /// The conversion from linear scene light to linear display light in 0 to 1.
    pub fn conversion(self) -> impl Fn(Vec3) -> Vec3 {
        let gain = exp2(self.exposure);
        move |color| self.transform.display(color * gain)
    }
}

/// How linear scene light becomes linear display light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ViewTransform {
    /// Colours whose brightest component is at most 1 do not change, so that a white background is white and the colours
    /// of a colour map match its legend. Brighter colours follow the hue-preserving part of the Khronos PBR Neutral tone
    /// mapper (2024): all components are scaled so that the brightest becomes 1, and brighter colours lose more
    /// saturation. A highlight on a coloured sphere therefore still has a gradient and ends in white.
    #[default]
    Neutral,
    /// Components above 1 are cut off.
    None,
    /// AgX (Sobotka, 2022) in the analytic form of Wrensch ("Minimal AgX Implementation", 2023): dark and bright light is
    /// compressed, and bright colours fade to white. White becomes a light grey.
    Agx,
    /// The tone scale of ACES 2.0 for displays of 100 nits (Academy Software Foundation, 2024), on each component of
    /// ACEScg, without the compression of the gamut.
    Aces,
}

impl ViewTransform {
    /// All of them, with the names in manifests.
    pub const NAMES: [(Self, &'static str); 4] = [
        (Self::Neutral, "neutral"),
        (Self::None, "none"),
        (Self::Agx, "agx"),
        (Self::Aces, "aces"),
    ];

    /// The one of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::NAMES.into_iter().find(|(_, known)| *known == name).map(|(transform, _)| transform)
    }

    /// Converts linear scene light to linear display light in 0 to 1.
    pub fn display(self, color: Vec3) -> Vec3 {
        // Replace NaN by 0, and negative light, which a display cannot show
        let color = Vec3::select(color.is_nan_mask(), Vec3::ZERO, color)
            .clamp(Vec3::ZERO, Vec3::splat(f32::MAX));
        match self {
            Self::Neutral => neutral(color),
            Self::None => color.min(Vec3::ONE),
            Self::Agx => agx(color),
            Self::Aces => aces(color),
        }
    }
}

/// Rate at which highlights fade to white with the amount of light above 1; the value of the Khronos tone mapper.
const DESATURATION: f32 = 0.15;

fn neutral(color: Vec3) -> Vec3 {
    let peak = color.max_element();
    if peak <= 1.0 {
        return color;
    }
    let white = 1.0 - 1.0 / (DESATURATION * (peak - 1.0) + 1.0);
    (color / peak).lerp(Vec3::ONE, white)
}

/// From linear sRGB to the primaries in which AgX compresses light, which are less saturated, and back from somewhat less
/// saturated ones: columns.
const AGX_INSET: Mat3 = Mat3::from_cols(
    Vec3::new(0.842_479_05, 0.042_328_242, 0.042_375_654),
    Vec3::new(0.078_433_6, 0.878_468_63, 0.078_433_6),
    Vec3::new(0.079_223_744, 0.079_166_13, 0.879_143),
);
const AGX_OUTSET: Mat3 = Mat3::from_cols(
    Vec3::new(1.196_879, -0.052_896_85, -0.052_971_635),
    Vec3::new(-0.098_020_88, 1.151_903_1, -0.098_043_45),
    Vec3::new(-0.099_029_74, -0.098_961_18, 1.151_073_7),
);
/// The range of light that AgX shows, stops from 1.
const AGX_STOPS: [f32; 2] = [-12.473_93, 4.026_069];
/// Coefficients of the curve of AgX, from the highest power to the constant.
const AGX_CURVE: [f32; 7] = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32];

fn agx(color: Vec3) -> Vec3 {
    let [darkest, brightest] = AGX_STOPS;
    let curve = |light: f32| {
        let stops = log2(light.max(f32::MIN_POSITIVE)).clamp(darkest, brightest);
        let x = (stops - darkest) / (brightest - darkest);
        AGX_CURVE.into_iter().fold(0.0, |sum, coefficient| sum * x + coefficient)
    };
    let compressed = Vec3::from_array((AGX_INSET * color).to_array().map(curve));
    let encoded = (AGX_OUTSET * compressed).clamp(Vec3::ZERO, Vec3::ONE);
    // The curve is for displays with this exponent
    Vec3::from_array(encoded.to_array().map(|v| pow(v, 2.2)))
}

/// From linear sRGB to ACEScg, with Bradford's adaptation of the white points, and back: columns.
const ACESCG_OF_SRGB: Mat3 = Mat3::from_cols(
    Vec3::new(0.613_097_4, 0.070_193_72, 0.020_615_594),
    Vec3::new(0.339_523_14, 0.916_353_9, 0.109_569_77),
    Vec3::new(0.047_379_45, 0.013_452_4, 0.869_814_6),
);
const SRGB_OF_ACESCG: Mat3 = Mat3::from_cols(
    Vec3::new(1.704_858_7, -0.130_076_82, -0.023_964_073),
    Vec3::new(-0.621_716, 1.140_735_7, -0.128_975_51),
    Vec3::new(-0.083_299_37, -0.010_559_801, 1.153_014),
);
/// Constants of the tone scale for a peak of 100 nits: `m_2`, `s_2`, the contrast `g`, and the toe `t_1`.
const ACES_TONE_SCALE: [f32; 4] = [1.047_103_8, 0.919_858_3, 1.15, 0.04];

fn aces(color: Vec3) -> Vec3 {
    let [scale, middle, contrast, toe] = ACES_TONE_SCALE;
    let curve = |light: f32| {
        let light = light.clamp(0.0, 1e6);
        let f = scale * pow(light / (light + middle), contrast);
        (f * f / (f + toe)).min(1.0)
    };
    let compressed = Vec3::from_array((ACESCG_OF_SRGB * color).to_array().map(curve));
    (SRGB_OF_ACESCG * compressed).clamp(Vec3::ZERO, Vec3::ONE)
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

    fn view_transform(color: Vec3) -> Vec3 {
        DisplayView::default().conversion()(color)
    }

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

    /// The constants of the tone scale from those of its specification ("Daniele Evo", in ACES 2.0's `Lib.Academy.Tonescale`).
    #[test]
    fn the_tone_scale_of_aces_is_that_of_100_nits() {
        let (n, g, c, c_d, w_g, t_1) = (100.0_f64, 1.15, 0.18, 10.013, 0.14, 0.04);
        let (r_hit, m_0) = (128.0, n / 100.0);
        let m_1 = 0.5 * (m_0 + (m_0 * (m_0 + 4.0 * t_1)).sqrt());
        let hit = r_hit / m_1;
        let m = m_1 / (hit / (hit + 1.0)).powf(g);
        let c_t = c_d / 100.0 * (1.0 + (n / 100.0).log2() * w_g);
        let g_ip: f64 = 0.5 * (c_t + (c_t * (c_t + 4.0 * t_1)).sqrt());
        let part = (g_ip / m).powf(1.0 / g);
        let w_2 = c / (-(m_1 * part) / (part - 1.0));
        let s_2 = w_2 * m_1;
        let m_2 = m_1 / (hit / (hit + w_2)).powf(g);
        let [scale, middle, contrast, toe] = ACES_TONE_SCALE.map(f64::from);
        assert!((scale - m_2).abs() < 1e-5 && (middle - s_2).abs() < 1e-5, "{m_2} {s_2}");
        assert!((contrast - g).abs() < 1e-6 && (toe - t_1).abs() < 1e-6);
        // Middle grey has 10 nits
        assert!((ViewTransform::Aces.display(Vec3::splat(0.18)).y - 0.1).abs() < 1e-3);
    }

    #[test]
    fn every_transform_keeps_grey_grey_and_rises_from_black_to_white() {
        for (transform, name) in ViewTransform::NAMES {
            assert_eq!(ViewTransform::of_name(name), Some(transform));
            assert!(transform.display(Vec3::ZERO).max_element() < 1e-3, "{name}");
            assert!(transform.display(Vec3::splat(1000.0)).min_element() > 0.95, "{name}");
            let mut last = -1.0;
            for step in 0..60_u8 {
                let light = exp2(f32::from(step) / 3.0 - 14.0);
                let shown = transform.display(Vec3::splat(light));
                assert!(shown.max_element() - shown.min_element() < 2e-3, "{name} {light} {shown}");
                assert!(shown.y >= last, "{name} {light}");
                last = shown.y;
            }
            let wild = transform.display(Vec3::new(f32::NAN, f32::INFINITY, -3.0));
            assert!(wild.is_finite() && wild.max_element() <= 1.0, "{name} {wild}");
        }
        // Middle grey stays about that, and a red light fades to white
        assert!((ViewTransform::Agx.display(Vec3::splat(0.18)).y - 0.2).abs() < 0.02);
        assert!(ViewTransform::Agx.display(Vec3::new(16.0, 0.2, 0.2)).y > 0.3);
        assert_eq!(ViewTransform::None.display(Vec3::new(2.0, 0.5, 0.0)), Vec3::new(1.0, 0.5, 0.0));
    }
}
