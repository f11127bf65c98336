//! The position and motion of the camera.

use serde_json::{Value, json};

use crate::manifest::CameraMode;
use crate::pipeline::Setup;
use crate::scene::{CameraPath, CameraView, Projection};

/// The camera over a range of frames.
pub(super) struct CameraSummary<'a> {
    path: &'a CameraPath,
    projection: Projection,
    mode: CameraMode,
    /// First frame.
    first: Option<i64>,
    last: Option<i64>,
}

impl<'a> CameraSummary<'a> {
    pub(super) fn new(setup: &'a Setup, mode: CameraMode, frames: &[i64]) -> Self {
        Self {
            path: &setup.picture.view.path,
            projection: setup.picture.view.projection,
            mode,
            first: frames.first().copied(),
            last: frames.last().copied(),
        }
    }

    fn view(&self, frame: Option<i64>) -> CameraView {
        frame.map_or_else(|| self.path.start(), |frame| self.path.view(frame))
    }

    pub(super) fn to_lines(&self) -> Vec<String> {
        let first_view = self.description(self.first);
        let mut lines = vec![format!("camera     {} {first_view}", self.mode.name())];
        let moving = self.path.moving();
        if let (Some(first), Some(last), [_, ..]) = (self.first, self.last, &moving[..]) {
            lines[0] += &format!(" at frame {first}");
            let last_view = self.description(Some(last));
            lines.push(format!("           {last_view} at frame {last}"));
            lines.push(format!("           {}", self.motion(&moving)));
        }
        lines
    }

    /// Describes the motion.
    fn motion(&self, moving: &[&str]) -> String {
        let verb = if moving.len() == 1 { "moves" } else { "move" };
        let what = format!("{} {verb}", moving.join(", "));
        match self.path {
            CameraPath::Still(_) => what,
            CameraPath::Turntable(turntable) => {
                let degrees = turntable.degrees_per_frame();
                format!("{what} around up, {degrees} degrees per frame")
            }
            CameraPath::Keys(path) => {
                let keys = path.keys();
                let frames = keys.first().zip(keys.last());
                let [from, to] = frames.map_or([0; 2], |(a, b)| [a.frame, b.frame]);
                format!("{what} through {} keys, frames {from} to {to}", keys.len())
            }
        }
    }

    pub(super) fn to_json(&self) -> Value {
        let moving = self.path.moving();
        let mut all = self.view_json(self.first);
        all["mode"] = json!(self.mode.name());
        if !moving.is_empty() {
            all["frame"] = json!(self.first);
            all["last"] = self.view_json(self.last);
            all["last"]["frame"] = json!(self.last);
        }
        all["moves"] = json!(moving);
        all
    }

    fn description(&self, frame: Option<i64>) -> String {
        let CameraView { eye, look_at, up, fov } = self.view(frame);
        let size = match self.projection {
            Projection::Perspective => format!("{fov} degrees"),
            Projection::Orthographic { height } => format!("orthographic, height {height:.4}"),
            Projection::Equirectangular => "equirectangular".to_owned(),
        };
        format!("from {eye:.4} to {look_at:.4}, up {up:.4}, {size}")
    }

    fn view_json(&self, frame: Option<i64>) -> Value {
        let view = self.view(frame);
        let mut json = json!({
            "eye": view.eye.to_array(),
            "look_at": view.look_at.to_array(),
            "up": view.up.to_array(),
        });
        match self.projection {
            Projection::Perspective => json["fov"] = json!(view.fov),
            Projection::Orthographic { height } => json["height"] = json!(height),
            Projection::Equirectangular => {}
        }
        json
    }
}
