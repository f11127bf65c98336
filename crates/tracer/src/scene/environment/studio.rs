//! The studio: a key light from above the viewer's left shoulder, a fill light, a rim light, and a pale dome.
//!
//! Tuned by eye on a dam break coloured with viridis, so that a colour that faces the camera is shown nearly as in
//! the colour map: irradiance over pi is 0.95 towards the viewer, 1.3 upwards and 0.2 downwards. A larger and dimmer
//! key light loses the shadows.

use glam::Vec3;

use super::{Environment, EnvironmentAxes};
use spherule_tree::math::functions::acos;

/// A round light with a soft edge.
struct Cap {
    /// Direction: right, back (towards the viewer), up. Of any length.
    direction: Vec3,
    /// Angle from the centre to the middle of the edge, radians.
    half_angle: f32,
    /// Half the width of the edge, radians.
    softness: f32,
    /// Radiance, linear RGB.
    radiance: Vec3,
    /// A cosine below that at the outer end of the edge.
    farthest: f32,
}

/// More than the error of a cosine.
const MARGIN: f32 = 1e-4;

const fn cap(direction: Vec3, [half_angle, softness]: [f32; 2], radiance: Vec3) -> Cap {
    Cap { direction, half_angle, softness, radiance, farthest: -1.0 }
}

/// Daylight, slightly warm, from the left and above.
const KEY: Cap = cap(Vec3::new(-0.75, 0.55, 1.0), [0.15, 0.05], Vec3::new(36.0, 34.74, 33.12));

/// A large cool light from the right.
const FILL: Cap = cap(Vec3::new(1.0, 0.7, 0.35), [0.6, 0.3], Vec3::new(0.68, 0.744, 0.8));

/// A light from behind, for outlines.
const RIM: Cap = cap(Vec3::new(0.35, -1.0, 0.6), [0.35, 0.15], Vec3::new(4.75, 4.85, 5.0));

/// The dome at the zenith, just above the horizon, just below it, and at the nadir.
const DOME: [Vec3; 4] = [
    Vec3::new(0.3724, 0.38, 0.3952),
    Vec3::new(0.3268, 0.3496, 0.38),
    Vec3::new(0.2356, 0.2318, 0.228),
    Vec3::new(0.1596, 0.1558, 0.152),
];

/// The studio around a viewer, times `scale` per component.
pub fn studio(axes: EnvironmentAxes, scale: Vec3) -> Environment {
    let caps = [KEY, FILL, RIM].map(|cap| Cap {
        direction: cap.direction.normalize(),
        farthest: libm::cosf(cap.half_angle + cap.softness) - MARGIN,
        ..cap
    });
    Environment::from_fn(axes, |direction| {
        let lights: Vec3 = caps.iter().map(|cap| cap.radiance(direction)).sum();
        scale * (dome(direction.z) + lights)
    })
}

impl Cap {
    /// Its radiance from `direction`: full inside, with a smooth edge.
    fn radiance(&self, direction: Vec3) -> Vec3 {
        // Most directions are far from it, and need no angle
        let cosine = direction.dot(self.direction);
        if cosine < self.farthest {
            return Vec3::ZERO;
        }
        let angle = acos(cosine.clamp(-1.0, 1.0));
        let part = (self.half_angle + self.softness - angle) / (2.0 * self.softness);
        let part = part.clamp(0.0, 1.0);
        part * part * (3.0 - 2.0 * part) * self.radiance
    }
}

/// Radiance of the dome at `height`, the sine of the elevation.
fn dome(height: f32) -> Vec3 {
    let [zenith, above, below, nadir] = DOME;
    if height > 0.0 { above.lerp(zenith, height) } else { below.lerp(nadir, -height) }
}
