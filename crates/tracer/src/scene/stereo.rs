//! Stereo pairs: the distance of the eyes, and the distance at which their views converge.

use super::camera::{CameraError, CameraView, Stereo};

/// Distance of the eyes as a part of the distance to the target, if none is given: a rule of stereo photography, for
/// which the depth of most scenes is comfortable to look at.
pub const EYE_DISTANCE: f64 = 1.0 / 30.0;

/// The eyes of a sequence of stereo pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoSettings {
    /// Distance of the eyes in scene units; by default [`EYE_DISTANCE`] of the distance to the target.
    pub eye_distance: Option<f64>,
    /// Where the views converge.
    pub convergence: Convergence,
}

/// The distance at which the views of two eyes converge. What is nearer appears in front of the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Convergence {
    /// The distance of the point that the camera looks at.
    Target,
    /// Infinitely far: the directions are parallel.
    Parallel,
    /// A distance along the view axis in scene units.
    Distance(f64),
}

impl StereoSettings {
    /// The eyes of a camera at `view`.
    ///
    /// # Errors
    /// If a length is out of range in single precision.
    pub fn stereo(&self, view: &CameraView) -> Result<Stereo, CameraError> {
        let target = (view.look_at - view.eye).length();
        let convergence = match self.convergence {
            Convergence::Target => target,
            Convergence::Parallel => f64::INFINITY,
            Convergence::Distance(distance) => distance,
        };
        let half_distance = 0.5 * self.eye_distance.unwrap_or(EYE_DISTANCE * target);
        #[expect(clippy::cast_possible_truncation, reason = "the renderer works in f32")]
        let [half_distance, convergence] = [half_distance as f32, convergence as f32];
        if half_distance.is_finite() && convergence > 0.0 {
            Ok(Stereo { half_distance, convergence })
        } else {
            Err(CameraError::Eyes)
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn eyes_follow_from_the_distance_to_the_target() {
        let view = CameraView {
            eye: DVec3::ZERO,
            look_at: DVec3::new(0.0, 6.0, 0.0),
            up: DVec3::Z,
            fov: 40.0,
        };
        let stereo = |eye_distance, convergence| {
            let settings = StereoSettings { eye_distance, convergence };
            settings.stereo(&view)
        };
        for (eye_distance, convergence, wanted) in [
            (None, Convergence::Target, [0.1, 6.0]),
            (Some(3.0), Convergence::Parallel, [1.5, f32::INFINITY]),
            (Some(3.0), Convergence::Distance(2.0), [1.5, 2.0]),
        ] {
            let found = stereo(eye_distance, convergence).unwrap();
            assert_eq!([found.half_distance, found.convergence], wanted);
        }
        let error = stereo(Some(1e300), Convergence::Target).unwrap_err();
        assert_eq!(error, CameraError::Eyes);
    }
}
