//! `[camera]`: where the picture is taken from. World coordinates.

use std::collections::BTreeSet;

use super::named;
use super::reader::{Field, Section};
use super::write::Entries;
use crate::scene::camera::DEFAULT_FOV;

named! {
    /// How the camera is placed.
    CameraMode {
        /// Framed on the bounds of the whole sequence.
        Auto = "auto",
        /// At `eye`, looking at `look_at`.
        Fixed = "fixed",
        /// Around the bounds of the whole sequence by `degrees_per_frame`.
        Turntable = "turntable",
        /// Through each `[[camera.key]]` at its frame.
        Keys = "keys",
    }
}

/// What the commented file says of keys where there are none.
pub(super) const NO_KEYS: &str = r#"
# In mode "keys" the camera goes smoothly through these, and stands before the first and after the last.
# [[camera.key]]
# frame = 1                               # the camera is there at this frame
# eye = [0.0, 0.0, 0.0]                   # where
# look_at = [5.0, 5.0, 0.0]               # the middle of the picture
# up = [0.0, 0.0, 1.0]                    # default: camera.up
# fov = 45.0                              # default: camera.fov
"#;

/// `[camera]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// How it is placed. Not given, it is fixed if there is an eye, by keys if there are keys, and
    /// auto otherwise.
    pub mode: CameraMode,
    /// Where it is. Always there if the mode is fixed.
    pub eye: Option<[f64; 3]>,
    /// What is in the middle of the picture. Always there if the mode is fixed.
    pub look_at: Option<[f64; 3]>,
    /// What is up in the picture; None is `input.up`.
    pub up: Option<[f64; 3]>,
    /// Vertical field of view, degrees.
    pub fov: f64,
    /// Degrees around the up axis, for auto and turntable (there, of frame 0); None is a good one.
    pub azimuth: Option<f64>,
    /// Degrees above the horizon, for auto and turntable; None is a good one.
    pub elevation: Option<f64>,
    /// How far a turntable turns from a frame to the next.
    pub degrees_per_frame: f64,
    /// `[[camera.key]]`, ascending by frame.
    pub keys: Vec<CameraKey>,
}

/// One place that the camera passes through.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraKey {
    /// Frame at which it is there.
    pub frame: i64,
    /// Where it is.
    pub eye: [f64; 3],
    /// What is in the middle of the picture.
    pub look_at: [f64; 3],
    /// What is up in the picture; None is `camera.up`.
    pub up: Option<[f64; 3]>,
    /// Vertical field of view, degrees; None is `camera.fov`.
    pub fov: Option<f64>,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            mode: CameraMode::Auto,
            eye: None,
            look_at: None,
            up: None,
            fov: DEFAULT_FOV,
            azimuth: None,
            elevation: None,
            degrees_per_frame: 1.0,
            keys: Vec::new(),
        }
    }
}

fn fov(field: &Field<'_>) -> Option<f64> {
    field.number("degrees between 0 and 180", |v| 0.0 < v && v < 180.0)
}

impl Camera {
    pub(super) fn read(mut section: Section<'_>) -> Self {
        let default = Self::default();
        let mode = section.optional("mode", |f| f.choice(CameraMode::ALL));
        let (eye, look_at) = (
            section.optional("eye", Field::point),
            section.optional("look_at", Field::point),
        );
        let up = section.optional("up", Field::direction);
        let mut camera = Self {
            mode: CameraMode::Auto,
            eye,
            look_at,
            up,
            fov: section.value("fov", default.fov, fov),
            azimuth: section.optional("azimuth", |f| f.number("degrees", |_| true)),
            elevation: section.optional("elevation", |f| {
                f.number("degrees from -90 to 90", |v| v.abs() <= 90.0)
            }),
            degrees_per_frame: section.value("degrees_per_frame", default.degrees_per_frame, |f| {
                f.number("degrees", |_| true)
            }),
            keys: read_keys(&mut section, up),
        };
        camera.mode = mode.unwrap_or(if camera.eye.is_some() {
            CameraMode::Fixed
        } else if camera.keys.is_empty() {
            CameraMode::Auto
        } else {
            CameraMode::Keys
        });
        camera.check(&section);
        section.finish();
        camera
    }

    fn check(&self, section: &Section<'_>) {
        let own = match self.mode {
            CameraMode::Auto => Some("the automatic camera finds its own; say mode = \"fixed\""),
            CameraMode::Turntable => {
                Some("a turntable finds its own; azimuth and elevation place it")
            }
            CameraMode::Keys => Some("each [[camera.key]] has its own"),
            CameraMode::Fixed => None,
        };
        for key in ["eye", "look_at"] {
            if let Some(own) = own.filter(|_| !section.lacks(key)) {
                section.wrong(key, &format!("is given, but {own}"));
            }
        }
        if self.mode == CameraMode::Fixed {
            for key in ["eye", "look_at"] {
                if section.lacks(key) {
                    section.missing(key, "a fixed camera needs it, as [5.0, 5.0, 0.0]");
                }
            }
            if let (Some(eye), Some(look_at)) = (self.eye, self.look_at) {
                if eye == look_at {
                    section.wrong("look_at", "is where the eye is; they must differ");
                } else if self.up.is_some_and(|up| are_parallel(up, eye, look_at)) {
                    section.wrong("up", "points along the view; it must not");
                }
            }
        }
        if self.mode == CameraMode::Keys && section.lacks("key") {
            section.missing("key", "mode = \"keys\" needs at least one [[camera.key]]");
        }
    }

    pub(super) fn entries(&self, out: &mut Entries) {
        out.section("camera");
        out.put("mode", &self.mode, "auto | fixed | turntable | keys");
        out.maybe(
            "eye",
            self.eye.as_ref(),
            "[0.0, 0.0, 0.0]",
            "fixed: where the camera is",
        );
        out.maybe(
            "look_at",
            self.look_at.as_ref(),
            "[5.0, 5.0, 0.0]",
            "fixed: the middle of the picture",
        );
        out.maybe(
            "up",
            self.up.as_ref(),
            "[0.0, 0.0, 1.0]",
            "default: input.up",
        );
        out.put("fov", &self.fov, "vertical, degrees");
        out.maybe(
            "azimuth",
            self.azimuth.as_ref(),
            "30.0",
            "auto, turntable: degrees around up",
        );
        out.maybe(
            "elevation",
            self.elevation.as_ref(),
            "20.0",
            "auto, turntable: degrees above the horizon",
        );
        out.put(
            "degrees_per_frame",
            &self.degrees_per_frame,
            "turntable: how fast it turns",
        );
        for (index, key) in self.keys.iter().enumerate() {
            out.item("camera.key", index);
            out.put("frame", &key.frame, "the camera is there at this frame");
            out.put("eye", &key.eye, "where");
            out.put("look_at", &key.look_at, "the middle of the picture");
            out.maybe(
                "up",
                key.up.as_ref(),
                "[0.0, 0.0, 1.0]",
                "default: camera.up",
            );
            out.maybe("fov", key.fov.as_ref(), "45.0", "default: camera.fov");
        }
    }
}

/// Every `[[camera.key]]`, ascending by frame; `camera_up` is for those without an up of their own.
fn read_keys(section: &mut Section<'_>, camera_up: Option<[f64; 3]>) -> Vec<CameraKey> {
    let mut taken = BTreeSet::new();
    let mut read = |key| CameraKey::read(key, camera_up, &mut taken);
    let mut keys: Vec<_> = section
        .sections("key")
        .into_iter()
        .filter_map(&mut read)
        .collect();
    keys.sort_by_key(|key| key.frame);
    keys
}

impl CameraKey {
    /// `taken` has the frames of the keys before it.
    fn read(
        mut section: Section<'_>,
        camera_up: Option<[f64; 3]>,
        taken: &mut BTreeSet<i64>,
    ) -> Option<Self> {
        let frame = section.optional("frame", |f| f.or_wants(f.as_integer(), "a frame number"));
        let eye = section.optional("eye", Field::point);
        let look_at = section.optional("look_at", Field::point);
        let up = section.optional("up", Field::direction);
        let fov = section.optional("fov", fov);
        for key in ["frame", "eye", "look_at"] {
            if section.lacks(key) {
                section.missing(key, "each [[camera.key]] needs frame, eye and look_at");
            }
        }
        if let Some(frame) = frame.filter(|frame| !taken.insert(*frame)) {
            section.wrong("frame", &format!("there is a key of frame {frame} already"));
        }
        if let (Some(eye), Some(look_at)) = (eye, look_at) {
            if eye == look_at {
                section.wrong("look_at", "is where the eye is; they must differ");
            } else if up
                .or(camera_up)
                .is_some_and(|up| are_parallel(up, eye, look_at))
            {
                section.wrong(
                    "up",
                    match up {
                        Some(_) => "points along the view; it must not",
                        None => "is camera.up, which points along the view; give the key another",
                    },
                );
            }
        }
        section.finish();
        Some(Self {
            frame: frame?,
            eye: eye?,
            look_at: look_at?,
            up,
            fov,
        })
    }
}

/// Whether `up` leaves no upright picture of `look_at` from `eye`.
fn are_parallel(up: [f64; 3], eye: [f64; 3], look_at: [f64; 3]) -> bool {
    let up = glam::DVec3::from(up).normalize_or_zero();
    let view = (glam::DVec3::from(look_at) - glam::DVec3::from(eye)).normalize_or_zero();
    up.cross(view).length() < 1e-9
}
