//! A camera that rotates around the particles at constant speed.

use glam::DVec3;

use crate::scene::framing::view_direction;
use crate::scene::{CameraView, Framed, Framing};

/// A camera that rotates around particles about the axis through the centre of their box, at constant height and
/// distance, and always looks at the same point of the axis.
///
/// It is as near as possible with all particles in the picture from all sides: the distance is computed for the circles
/// on which they rotate, so it does not depend on the frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turntable {
    look_at: DVec3,
    distance: f64,
    /// The framing at frame 0, with a normalised up vector.
    framing: Framing,
    degrees_per_frame: f64,
}

impl Turntable {
    pub(super) fn new(framed: &Framed, framing: &Framing, degrees_per_frame: f64) -> Self {
        let framing = level(framing);
        let (shift, distance) = fit(framed, &framing);
        Self {
            look_at: framed.bounds().center() + shift * framing.up,
            distance,
            framing,
            degrees_per_frame,
        }
    }

    /// The same for orthographic images, with their height in scene units.
    pub(super) fn parallel(
        framed: &Framed,
        framing: &Framing,
        degrees_per_frame: f64,
    ) -> (Self, f64) {
        let framing = level(framing);
        let slant = slant(&framing);
        let [height, shift] = framed.turning_height(&framing, slant);
        let turntable = Self {
            look_at: framed.bounds().center() + shift * framing.up,
            distance: framed.far() + (shift * slant[0]).abs(),
            framing,
            degrees_per_frame,
        };
        (turntable, height)
    }

    /// The same with a field of view that is a function of the present one, degrees.
    pub(super) fn with_fov(mut self, change: impl Fn(f64) -> f64) -> Self {
        self.framing.fov = change(self.framing.fov);
        self
    }

    /// The view `after` frames after `frame`.
    pub(super) fn view(&self, frame: i64, after: f64) -> CameraView {
        let Framing { up, elevation, .. } = self.framing;
        let rotation = rotation_at(self.degrees_per_frame, frame) + self.degrees_per_frame * after;
        let azimuth = self.framing.azimuth + rotation;
        CameraView {
            eye: self.look_at - self.distance * view_direction(up, azimuth, elevation),
            look_at: self.look_at,
            up,
            fov: self.framing.fov,
        }
    }

    /// Rotation from one frame to the next.
    pub const fn degrees_per_frame(&self) -> f64 {
        self.degrees_per_frame
    }

    pub(super) fn turns(&self) -> bool {
        self.degrees_per_frame % 360.0 != 0.0
    }
}

/// The framing with a normalised up vector, and not along it.
fn level(framing: &Framing) -> Framing {
    Framing {
        up: framing.up.try_normalize().unwrap_or(DVec3::Z),
        elevation: framing.elevation.clamp(-89.0, 89.0),
        ..*framing
    }
}

/// Sine and cosine of the elevation.
fn slant(framing: &Framing) -> [f64; 2] {
    let direction = view_direction(framing.up, 0.0, framing.elevation);
    [-direction.dot(framing.up), direction.cross(framing.up).length()]
}

/// Height of the target point above the centre of `framed`, and its distance.
///
/// Derived like the view of [`crate::scene::framing`], for the circles on which the points rotate. Let `r` and `h` be
/// the position of a point from the axis and along it, and `e` the elevation. During the rotation it appears at `x =
/// r sin a`, `y = h cos e - r cos a sin e` and depth `d = -(h sin e + r cos a cos e)`. The largest `D` that `|x| <= t
/// (D + d)` requires is `h sin e + r sqrt(1/t^2 + cos^2 e)`, and the extremes of `y -+ t d` are in front of the axis
/// or behind it.
fn fit(framed: &Framed, framing: &Framing) -> (f64, f64) {
    // Find the view, and the half extent of the image
    let [sin, cos] = slant(framing);
    let half = framed.half_extent(framing);
    let bounds = framed.bounds();
    let mut distance = framed.min_distance();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for point in framed.points() {
        // Fit the circle of the point horizontally
        let relative = *point - bounds.center();
        let height = relative.dot(framing.up);
        let radius = relative.cross(framing.up).length();
        let across = radius * libm::hypot(cos, 1.0 / half.x) + framed.reach(half.x) / half.x;
        distance = distance.max(height * sin + across);
        // Fit it vertically, at its front and back
        for front in [radius, -radius] {
            let (y, d) = (height * cos - front * sin, -(height * sin + front * cos));
            high = high.max(y - half.y * d);
            low = low.min(y + half.y * d);
        }
    }
    distance = distance.max((0.5 * (high - low) + framed.reach(half.y)) / half.y);
    // Split the shift in the image plane into a shift along the axis and one along the view
    let shift = 0.5 * (high + low) / cos;
    // A line along the axis could be viewed from its own end, where the view direction is undefined.
    let least = 1e-6 * bounds.diagonal();
    (shift, (distance - shift * sin).max(least))
}

/// Rotation in degrees at `frame`, within one turn; exact to the last bit however far the frame is from 0.
#[expect(clippy::cast_precision_loss, reason = "each part has no more than 32 bits that are not 0")]
fn rotation_at(degrees_per_frame: f64, frame: i64) -> f64 {
    // Whole turns per frame have no effect, and the remainder is exact.
    let step = degrees_per_frame % 360.0;
    let low = frame & 0xffff_ffff;
    let part = |frames: i64| {
        let product = step * frames as f64;
        let lost = step.mul_add(frames as f64, -product);
        (product % 360.0 + lost) % 360.0
    };
    (part(frame - low) + part(low)) % 360.0
}

#[cfg(test)]
#[path = "turntable_tests.rs"]
mod tests;
