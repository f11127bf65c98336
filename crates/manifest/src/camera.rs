//! `[camera]`: position and motion of the camera. World coordinates.

use std::collections::BTreeSet;

use glam::DVec3;
use spherule_tracer::scene::camera::DEFAULT_FOV;
use spherule_tracer::scene::lens::DEFAULT_SENSOR_WIDTH;

use super::focus::FocusSetting;
use super::keys::{Keys, keys, section};
use super::reader::Section;
use super::value::named;

mod fit;
mod projection;
mod rules;

pub use fit::{BoxSetting, FitSetting};
pub use projection::{AxisView, ConvergenceSetting, ProjectionKind};
pub(super) use rules::RULES;

named! {
    /// Placement of the camera.
    CameraMode {
        /// Framed on the bounds of the whole sequence.
        Auto = "auto",
        /// At `eye`, looking at `look_at`.
        Fixed = "fixed",
        /// Rotating around the bounds of the whole sequence by `degrees_per_frame`.
        Turntable = "turntable",
        /// Through each `[[camera.key]]` at its frame.
        Keys = "keys",
    }
}

section! {
    /// Position and motion of the camera
    Camera {
        /// Placement: auto | fixed | turntable | keys
        ///
        /// Without a mode, the camera is fixed if there is an eye, moves through the keys if there are keys, and is
        /// placed automatically otherwise.
        mode: CameraMode = CameraMode::Auto;
        /// fixed: position of the camera
        eye: Option<DVec3> = None, example("[0.0, 0.0, 0.0]"), flag("eye", "X,Y,Z", "Camera");
        /// fixed: target point, in the centre of the image
        look_at: Option<DVec3> = None, example("[5.0, 5.0, 0.0]"), flag("look-at", "X,Y,Z", "Camera");
        /// Direction that points up in the image
        up: Option<DVec3> = None, direction(), example("[0.0, 0.0, 1.0]"), unset("input.up");
        /// Projection: perspective | orthographic | equirectangular
        ///
        /// orthographic is without perspective, for figures whose lengths are measured. equirectangular shows all
        /// directions around the eye; its pictures should be twice as wide as high.
        projection: ProjectionKind = ProjectionKind::Perspective, flag("projection", "PROJECTION", "Camera");
        /// orthographic: height of the picture in scene units
        height: Option<f64> = None, or("auto"), above(0), unit("a length");
        /// Vertical field of view, degrees; cameras that are placed automatically have 25 by default
        fov: f64 = DEFAULT_FOV, above(0), below(180), unit("degrees"), flag("fov", "DEGREES", "Camera");
        /// auto, turntable: the side to look from: front | back | left | right | top | bottom | iso
        ///
        /// It stands for azimuth and elevation. The front view looks along +y if z is up, and along -z if y is up.
        view: Option<AxisView> = None, example("\"front\""), unset("azimuth and elevation"),
            flag("view", "SIDE", "Camera");
        /// auto, turntable: degrees around the up axis
        azimuth: Option<f64> = None, unit("degrees"), example("30.0"), flag("azimuth", "DEGREES", "Camera");
        /// auto, turntable: degrees above the horizon
        elevation: Option<f64> = None, from(-90), to(90), unit("degrees"), example("20.0"),
            flag("elevation", "DEGREES", "Camera");
        /// auto, turntable: what is in the picture: all | this | a percentage, such as 99%
        ///
        /// 99% is that part of the particles of all frames together; the others are left out if they are far from these.
        /// this is the same for the frame of a still alone. all is every particle of all frames, except at most 1 % of a
        /// frame that are far from the others.
        fit: Option<FitSetting> = None, example("\"99%\""), unset("for stills this, else 99%"), flag("fit", "WHAT", "Camera");
        /// auto: the point in the middle of the picture
        center: Option<DVec3> = None, example("[0.5, 0.5, 0.5]");
        /// Enlarges the picture around its middle
        zoom: f64 = 1.0, above(0), to(10_000), flag("zoom", "FACTOR", "Camera");
        /// auto, turntable: show all of the meshes, too, not only the particles
        ///
        /// Holdouts and meshes that each frame has for itself do not count.
        frame_meshes: bool = false;
        /// turntable: rotation from one frame to the next, degrees
        degrees_per_frame: f64 = 1.0, unit("degrees");
        /// f-number of the lens; 0 is a pinhole, with everything in focus
        ///
        /// The diameter of the aperture is the focal length divided by the f-number. The focal length is
        /// sensor_width * height / (2 * width * tan(fov / 2)), with width and height of the image.
        f_stop: f64 = 0.0, from(0), zero("a pinhole");
        /// Width of the sensor in scene units; 0.036 is a 36 mm film still in metres
        ///
        /// It only affects the aperture that f_stop gives.
        sensor_width: f64 = DEFAULT_SENSOR_WIDTH, above(0), unit("a length");
        /// Diameter of the aperture in scene units, in place of f_stop
        aperture: Option<f64> = None, from(0), unit("a length"), example("0.05"), unset("by f_stop");
        /// In focus: auto (look_at), a distance along the view, or { particle = ID }
        ///
        /// auto focuses on the target point of the camera. A particle is followed by its id through all frames.
        focus: FocusSetting = FocusSetting::Auto;
        /// Stereo pairs: the image of the left eye, and beside it that of the right one
        ///
        /// Each has the size of image.width and image.height. Equirectangular images are below each other.
        stereo: bool = false;
        /// stereo: distance of the eyes in scene units; auto is 1/30 of the distance to look_at
        eye_distance: Option<f64> = None, or("auto"), above(0), unit("a length");
        /// stereo: distance that appears at the screen: auto (look_at), parallel, or a distance along the view
        convergence: ConvergenceSetting = ConvergenceSetting::DEFAULT;
        /// Motion blur: how long the shutter is open, as a fraction of the time between frames; 0 is none
        ///
        /// 0.5 is a film camera with a shutter of 180 degrees. Particles move with their velocities, or, if they have
        /// ids but no velocities, to their places in the next frame. output.frame_time is the time between frames.
        shutter: f64 = 0.0, from(0), to(1), zero("no motion blur");
        /// When the shutter opens, as a fraction of the time between frames, before (negative) or after the frame
        shutter_offset: Option<f64> = None, from(-1), to(1), example("0.0"), unset("the frame in the middle");
        /// Number of steps in which a union or a smooth surface moves while the shutter is open
        ///
        /// Each has a structure of its own, in time and memory. Spheres move continuously.
        shutter_slices: u32 = 8, from(1), to(64);
        @
        /// `[[camera.key]]`, ascending by frame
        keys: Vec<CameraKey>;
        @
        /// The box that is in the picture in place of the particles
        bounds: Option<BoxSetting>;
    }
}

/// The message for incomplete keys of the camera.
const KEY_NEEDS: &str = "each [[camera.key]] needs frame, eye and look_at";

section! {
    /// Views that the camera passes through
    CameraKey {
        /// Frame at which the camera has this view
        frame: i64 = 0, required(KEY_NEEDS), example("1");
        /// Position of the camera
        eye: DVec3 = DVec3::ZERO, required(KEY_NEEDS), example("[0.0, 0.0, 0.0]");
        /// Target point, in the centre of the image
        look_at: DVec3 = DVec3::ZERO, required(KEY_NEEDS), example("[5.0, 5.0, 0.0]");
        /// Direction that points up in the image
        up: Option<DVec3> = None, direction(), example("[0.0, 0.0, 1.0]"), unset("camera.up");
        /// Vertical field of view, degrees; cameras that are placed automatically have 25 by default
        fov: Option<f64> = None, above(0), below(180), unit("degrees"), example("45.0"), unset("camera.fov");
    }
}

impl Camera {
    /// All keys, including those of `[[camera.key]]`.
    pub(super) fn all_keys(&mut self, keys: &mut Keys<'_>) {
        self.keys(keys);
        keys!(keys:
            /// auto, turntable: two corners of a box that is in the picture in place of the particles
            box => self.bounds, example("[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]");
        );
        // Keys of its path, each checked as soon as it is read
        let (up, mut frames) = (self.up, BTreeSet::new());
        let items = &mut self.keys;
        let has_fov = self.projection == ProjectionKind::Perspective;
        keys.list("key", "camera.key", CameraKey::ABOUT, items, |key, keys| {
            key.keys(keys);
            if let Some(section) = keys.reading() {
                key.check(section, up, &mut frames);
                if key.fov.is_some() && !has_fov {
                    section.wrong(
                        "fov",
                        "is given, but only perspective has a field of view; remove it",
                    );
                }
            }
        });
        // Checks of several keys together
        if let Some(section) = keys.reading() {
            self.keys.sort_by_key(|key| key.frame);
            if !section.has("mode") {
                self.mode = self.usual_mode();
            }
            section.check(RULES);
            self.check(section);
        }
    }

    fn usual_mode(&self) -> CameraMode {
        match (self.eye, self.keys.is_empty()) {
            (Some(_), _) => CameraMode::Fixed,
            (None, true) => CameraMode::Auto,
            (None, false) => CameraMode::Keys,
        }
    }

    /// Checks that the view of a fixed camera is valid.
    fn check(&self, section: &Section<'_>) {
        if self.mode == CameraMode::Fixed
            && let (Some(eye), Some(look_at)) = (self.eye, self.look_at)
        {
            if eye == look_at {
                section.wrong("look_at", "is where the eye is; they must differ");
            } else if self.up.is_some_and(|up| are_parallel(up, eye, look_at)) {
                section.wrong("up", "points along the view; it must not");
            }
        }
    }
}

impl CameraKey {
    /// Checks one key. `camera_up` is for keys without an up vector; `frames` contains the frames of the previous keys.
    fn check(&self, section: &Section<'_>, camera_up: Option<DVec3>, frames: &mut BTreeSet<i64>) {
        if section.has("frame") && !frames.insert(self.frame) {
            section.wrong("frame", &format!("there is a key of frame {} already", self.frame));
        }
        if !(section.has("eye") && section.has("look_at")) {
            return;
        }
        let is_parallel = |up| are_parallel(up, self.eye, self.look_at);
        if self.eye == self.look_at {
            section.wrong("look_at", "is where the eye is; they must differ");
        } else if self.up.is_some_and(is_parallel) {
            section.wrong("up", "points along the view; it must not");
        } else if self.up.is_none() && camera_up.is_some_and(is_parallel) {
            section.wrong("up", "is camera.up, which points along the view; give the key another");
        }
    }
}

/// Whether `up` is parallel to the view from `eye` to `look_at`, so that the image has no upright orientation.
fn are_parallel(up: DVec3, eye: DVec3, look_at: DVec3) -> bool {
    let (up, view) = (up.normalize_or_zero(), (look_at - eye).normalize_or_zero());
    up.cross(view).length() < 1e-9
}
