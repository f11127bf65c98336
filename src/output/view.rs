//! From scene light to a screen: a shoulder for highlights, then the sRGB transfer function.
//!
//! The shoulder has the form of Khronos's PBR neutral tone mapper (2024): colours whose brightest
//! component stays under [`KNEE`] are left exactly as they are; above, that component runs into 1
//! along a hyperbola of matching slope, the others keep their ratio to it, and very bright ones
//! slowly lose saturation so that a highlight ends white. That mapper's dark end, which takes out
//! reflections of a white sky, is left out: nothing is taken from dark colours here.

use glam::Vec3;

/// Brightest component (linear) up to which colours stay true; about 231 of 255 on the screen.
pub const KNEE: f32 = 0.8;

/// How fast highlights go to white with the light that the shoulder takes away.
const DESATURATION: f32 = 0.15;

/// Linear scene light to linear screen light in 0 to 1.
pub fn view_transform(color: Vec3) -> Vec3 {
    // NaN must not spread; a screen shows no negative light.
    let color = Vec3::select(color.is_nan_mask(), Vec3::ZERO, color);
    let color = color.clamp(Vec3::ZERO, Vec3::splat(f32::MAX));
    let peak = color.max_element();
    if peak <= KNEE {
        return color;
    }
    let room = 1.0 - KNEE;
    let shown = 1.0 - room * room / (peak - KNEE + room);
    let white = 1.0 - 1.0 / (DESATURATION * (peak - shown) + 1.0);
    (color * (shown / peak)).lerp(Vec3::splat(shown), white)
}

/// The sRGB transfer function (IEC 61966-2-1) for linear light in 0 to 1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// A screen's byte for linear light.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "in 0 to 255 after clamping; NaN becomes 0"
)]
pub fn byte_from_linear(linear: f32) -> u8 {
    (srgb_from_linear(linear.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_tones_stay_true() {
        for color in [
            Vec3::splat(0.18),
            Vec3::new(0.8, 0.1, 0.0),
            Vec3::new(0.02, 0.5, 0.7),
        ] {
            assert_eq!(view_transform(color), color);
        }
        assert_eq!(byte_from_linear(0.18), 118);
        assert_eq!(byte_from_linear(0.0), 0);
        assert_eq!(byte_from_linear(1.0), 255);
        // The linear piece: 0.002 * 12.92 * 255 = 6.59.
        assert_eq!(byte_from_linear(0.002), 7);
    }

    #[test]
    fn the_shoulder_is_smooth_and_never_clips() {
        let shown = |v: f32| view_transform(Vec3::splat(v)).x;
        let mut last = shown(0.79);
        let mut step = 0.79_f32;
        while step < 100.0 {
            step *= 1.01;
            let next = shown(step);
            assert!(next > last && next < 1.0, "{step}: {next}");
            last = next;
        }
        // Slope 1 on both sides of the knee.
        let slope = (shown(KNEE + 1e-3) - shown(KNEE)) / 1e-3;
        assert!((slope - 1.0).abs() < 0.02, "{slope}");
    }

    #[test]
    fn very_bright_colours_go_to_white() {
        let mild = view_transform(Vec3::new(1.0, 0.5, 0.25));
        let bright = view_transform(Vec3::new(100.0, 50.0, 25.0));
        assert!(mild.z / mild.x < 0.3);
        assert!(bright.z / bright.x > 0.8);
        let wild = Vec3::new(f32::NAN, f32::INFINITY, -3.0);
        assert!(view_transform(wild).is_finite());
    }
}
