//! The background for rays without an intersection: one colour, a vertical gradient, or the backdrop of a studio.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use spherule_tree::math::functions::asin;

/// Bottom of the default gradient (linear RGB): a light grey as in a photo studio. The dark ends of colour maps stand
/// out against it, it is suitable for print, and its reflection makes particles look round.
pub const DEFAULT_BOTTOM: Vec3 = Vec3::new(0.45, 0.47, 0.50);

/// Top of the default gradient (linear RGB): a lighter, cooler grey, like a sky.
pub const DEFAULT_TOP: Vec3 = Vec3::new(0.75, 0.79, 0.85);

/// Bottom of the backdrop of a studio (linear RGB), before its corners are darkened.
pub const STUDIO_BOTTOM: Vec3 = Vec3::new(0.62, 0.64, 0.67);

/// Top of the backdrop of a studio.
pub const STUDIO_TOP: Vec3 = Vec3::new(0.80, 0.82, 0.85);

/// The brightest point of the backdrop of a studio, on the film; (0, 0) is the top left corner, (1, 1) the bottom right
/// one.
pub const STUDIO_CENTER: [f32; 2] = [0.5, 0.45];

/// Fraction by which the corners of a studio are darkened at most.
const VIGNETTE: f32 = 0.25;

/// Growth of the darkening with the squared distance from the centre.
const FALLOFF: f32 = 1.6;

/// Factor on horizontal distances from the centre.
const STRETCH: f32 = 1.15;

/// The backdrop of a studio at a position of the film, linear RGB: a vertical gradient that is darker towards the
/// corners.
#[inline(always)]
pub fn studio_on_film([x, y]: [f32; 2]) -> [f32; 3] {
    let (bottom, top) = (STUDIO_BOTTOM.to_array(), STUDIO_TOP.to_array());
    let across = STRETCH * (x - STUDIO_CENTER[0]);
    let down = y - STUDIO_CENTER[1];
    let darkening = FALLOFF * (across * across + down * down);
    let darkening = if darkening < 1.0 { darkening } else { 1.0 };
    let brightness = 1.0 - VIGNETTE * darkening;
    [0, 1, 2].map(|axis| brightness * (top[axis] * (1.0 - y) + bottom[axis] * y))
}

/// Colour by direction, linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// The same in every direction.
    Constant(Vec3),
    /// From `bottom` straight down to `top` straight up, linear in the angle above the horizon.
    Gradient {
        /// Colour opposite to `up`.
        bottom: Vec3,
        /// Colour along `up`.
        top: Vec3,
        /// Unit vector.
        up: Vec3,
    },
    /// As in a photo studio: for camera rays a vertical gradient over the image with darker corners, which does not
    /// move with the camera; for all other rays a gradient along `up`.
    Studio {
        /// Unit vector.
        up: Vec3,
    },
}

impl Background {
    /// The default background, a calm gradient.
    pub fn default_for(up: Vec3) -> Self {
        Self::Gradient { bottom: DEFAULT_BOTTOM, top: DEFAULT_TOP, up: up.normalize_or(Vec3::Z) }
    }

    /// The same background with its gradient along `up`.
    #[must_use]
    pub fn with_up(self, up: Vec3) -> Self {
        match self {
            Self::Constant(_) => self,
            Self::Gradient { bottom, top, .. } => Self::Gradient { bottom, top, up },
            Self::Studio { .. } => Self::Studio { up },
        }
    }

    /// The colour of a camera ray in unit `direction` through a position of the film; (0, 0) is the top left corner,
    /// (1, 1) the bottom right one.
    pub fn color_on_film(&self, direction: Vec3, film: Vec2) -> Vec3 {
        match self {
            Self::Studio { .. } => Vec3::from_array(studio_on_film(film.to_array())),
            _ => self.color(direction),
        }
    }

    /// The colour in unit `direction`; for a camera ray, that of a studio depends on its position on the film instead.
    pub fn color(&self, direction: Vec3) -> Vec3 {
        let (bottom, top, up) = match *self {
            Self::Constant(color) => return color,
            Self::Gradient { bottom, top, up } => (bottom, top, up),
            Self::Studio { up } => (STUDIO_BOTTOM, STUDIO_TOP, up),
        };
        let height = asin(direction.dot(up).clamp(-1.0, 1.0));
        bottom.lerp(top, 0.5 + height * FRAC_1_PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_is_linear_in_the_angle() {
        let sky =
            Background::Gradient { bottom: Vec3::ZERO, top: Vec3::new(1.0, 2.0, 4.0), up: Vec3::Z };
        for (degrees, part) in [(-90.0_f32, 0.0), (-45.0, 0.25), (0.0, 0.5), (90.0, 1.0)] {
            let angle = degrees.to_radians();
            let color = sky.color(Vec3::new(angle.cos(), 0.0, angle.sin()));
            let expected = part * Vec3::new(1.0, 2.0, 4.0);
            assert!((color - expected).length() < 1e-3, "{degrees}: {color}");
        }
        // Rounding past one must not make NaN.
        assert!(sky.color(Vec3::new(0.0, 0.0, 1.000_001)).is_finite());
    }

    #[test]
    fn constant_is_constant() {
        let color = Vec3::new(0.1, 0.2, 0.3);
        assert_eq!(Background::Constant(color).color(Vec3::X), color);
    }
}
