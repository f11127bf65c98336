//! Around particles at an even pace.

use glam::DVec3;

use crate::scene::camera::{half_extent, least_distance, view_direction};
use crate::scene::{Bounds, CameraView, Framing};

/// A camera that goes around a box about the axis through its middle, at one height and one distance,
/// always looking at the same point of the axis.
///
/// It stands as near as it can with the whole box in the picture from every side, by what the corners
/// sweep in a full turn: which frames there are makes no difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turntable {
    look_at: DVec3,
    distance: f64,
    /// With an up of length 1; its azimuth is that of frame 0.
    framing: Framing,
    degrees_per_frame: f64,
}

impl Turntable {
    pub(super) fn new(bounds: &Bounds, framing: &Framing, degrees_per_frame: f64) -> Self {
        let up = framing.up.try_normalize().unwrap_or(DVec3::Z);
        let framing = Framing { up, ..*framing };
        let (shift, distance) = fit(bounds, &framing);
        Self {
            look_at: bounds.center() + shift * up,
            distance,
            framing,
            degrees_per_frame,
        }
    }

    pub(super) fn view(&self, frame: i64) -> CameraView {
        let Framing { up, elevation, .. } = self.framing;
        let azimuth = self.framing.azimuth + turned(self.degrees_per_frame, frame);
        CameraView {
            eye: self.look_at - self.distance * view_direction(up, azimuth, elevation),
            look_at: self.look_at,
            up,
            fov: self.framing.fov,
        }
    }

    /// How far it turns from a frame to the next.
    pub const fn degrees_per_frame(&self) -> f64 {
        self.degrees_per_frame
    }

    pub(super) fn turns(&self) -> bool {
        self.degrees_per_frame % 360.0 != 0.0
    }
}

/// Height over the middle of `bounds` of the point looked at, and its distance.
///
/// As [`crate::scene::Camera::framing`], for the circles on which the corners go around: with `r` and
/// `h` a corner's place from the axis and along it and `e` the elevation, it is seen in turn at
/// `x = r sin a`, `y = h cos e - r cos a sin e` and depth `d = -(h sin e + r cos a cos e)`. What
/// `|x| <= t (D + d)` asks of `D` is largest at `h sin e + r sqrt(1/t^2 + cos^2 e)`, and `y -+ t d` have
/// their extremes in front of the axis or behind it.
fn fit(bounds: &Bounds, framing: &Framing) -> (f64, f64) {
    let direction = view_direction(framing.up, 0.0, framing.elevation);
    let (sin, cos) = (
        -direction.dot(framing.up),
        direction.cross(framing.up).length(),
    );
    let half = half_extent(framing);
    let center = bounds.center();
    let mut distance = least_distance(bounds);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for corner in bounds.corners().map(|corner| corner - center) {
        let height = corner.dot(framing.up);
        let radius = corner.cross(framing.up).length();
        distance = distance.max(height * sin + radius * libm::hypot(cos, 1.0 / half.x));
        for front in [radius, -radius] {
            let (y, d) = (height * cos - front * sin, -(height * sin + front * cos));
            high = high.max(y - half.y * d);
            low = low.min(y + half.y * d);
        }
    }
    distance = distance.max(0.5 * (high - low) / half.y);
    // The view's shift on the screen, as one along the axis and one along the view.
    let shift = 0.5 * (high + low) / cos;
    // A line along the axis can be seen whole from its own end; there is no direction in that.
    let least = 1e-6 * bounds.diagonal();
    (shift, (distance - shift * sin).max(least))
}

/// Degrees turned at `frame`, within a turn, to the last bit however far the frame is from 0.
#[expect(
    clippy::cast_precision_loss,
    reason = "each part has no more than 32 bits that are not 0"
)]
fn turned(degrees_per_frame: f64, frame: i64) -> f64 {
    // Whole turns a frame are none, and a remainder is exact.
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
