//! Camera paths. The thesis only names them (rotation, translation, both); these paths reproduce the character of its
//! results: a small spread over a rotation, and a large one over a translation, because the particles grow from a
//! small part of the view to all of it and then leave it.

use std::f64::consts::TAU;
use std::fmt;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use spherule_tracer::scene::CameraView;

/// Motion of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Motion {
    /// One turn around the centre of the particles, about the up vector of the camera, from its position.
    Rotation,
    /// Straight along the view: from twice the distance to the target point, to that point, and the same distance
    /// beyond it. The first third is before the still view, the second third from there to the target, the last third
    /// behind it.
    Translation,
    /// Both at the same time: a spiral.
    Both,
}

impl Motion {
    /// All motions.
    pub const ALL: [Self; 3] = [Self::Rotation, Self::Translation, Self::Both];

    /// The name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rotation => "rotation",
            Self::Translation => "translation",
            Self::Both => "both",
        }
    }

    /// The view at `t` in 0..1 of the path that belongs to the still view `start` around `center`.
    pub(super) fn view_at(self, t: f64, start: &CameraView, center: DVec3) -> CameraView {
        match self {
            Self::Rotation => orbited(start, center, t),
            Self::Translation => shifted(start, t),
            Self::Both => orbited(&shifted(start, t), center, t),
        }
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

fn orbited(view: &CameraView, center: DVec3, turns: f64) -> CameraView {
    let turn = DQuat::from_axis_angle(view.up.normalize_or(DVec3::Z), turns * TAU);
    let around = |point: DVec3| center + turn * (point - center);
    CameraView { eye: around(view.eye), look_at: around(view.look_at), ..*view }
}

fn shifted(view: &CameraView, t: f64) -> CameraView {
    let shift = (3.0 * t - 1.0) * (view.look_at - view.eye);
    CameraView { eye: view.eye + shift, look_at: view.look_at + shift, ..*view }
}

/// Position on the path of image `index` in a run with a time limit: the van der Corput sequence, so that any number
/// of images is evenly distributed over the path, and fast and slow machines use the same positions.
pub(super) fn path_position(index: u32) -> f64 {
    f64::from(index.reverse_bits()) / 2_f64.powi(32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: CameraView = CameraView {
        eye: DVec3::ZERO,
        look_at: DVec3::new(5.0, 5.0, 0.0),
        up: DVec3::Z,
        fov: 45.0,
    };
    const CENTER: DVec3 = DVec3::new(5.0, 6.5, 0.0);

    #[track_caller]
    fn close(a: DVec3, b: DVec3) {
        assert!(a.distance(b) < 1e-12, "{a} is not {b}");
    }

    #[test]
    fn rotation_is_one_turn_at_constant_distance() {
        let at = |t| Motion::Rotation.view_at(t, &START, CENTER);
        assert_eq!(at(0.0), START);
        close(at(0.5).eye, DVec3::new(10.0, 13.0, 0.0));
        close(at(0.25).eye, DVec3::new(11.5, 1.5, 0.0));
        for t in [0.1, 0.6, 0.9] {
            assert!((at(t).eye.distance(CENTER) - CENTER.length()).abs() < 1e-12);
            assert_eq!(at(t).up, DVec3::Z);
        }
    }

    #[test]
    fn translation_passes_the_still_view_and_the_target() {
        let at = |t| Motion::Translation.view_at(t, &START, CENTER);
        close(at(0.0).eye, DVec3::new(-5.0, -5.0, 0.0));
        close(at(1.0 / 3.0).eye, START.eye);
        close(at(2.0 / 3.0).eye, START.look_at);
        close(at(0.9).look_at - at(0.9).eye, START.look_at);
    }

    #[test]
    fn both_is_translation_then_rotation() {
        let view = Motion::Both.view_at(0.5, &START, CENTER);
        // The camera has moved by half of (5, 5, 0), then half a turn around the centre.
        close(view.eye, 2.0 * CENTER - DVec3::new(2.5, 2.5, 0.0));
    }

    #[test]
    fn path_positions_are_evenly_distributed() {
        let places: Vec<f64> = (0..4).map(path_position).collect();
        assert_eq!(places, [0.0, 0.5, 0.25, 0.75]);
        let mut many: Vec<f64> = (0..48).map(path_position).collect();
        many.sort_unstable_by(f64::total_cmp);
        assert!(many.windows(2).all(|w| w[1] - w[0] <= 1.0 / 32.0));
    }
}
