//! The projection of the camera, views along axes, and stereo pairs.

use glam::DVec3;
use serde_json::{Value as Json, json};
use spherule_tracer::scene::Convergence;
use spherule_tracer::scene::framing::{DEFAULT_AZIMUTH, DEFAULT_ELEVATION, view_direction};

use super::Camera;
use crate::field::Field;
use crate::key::Key;
use crate::value::{Fault, FlagKind, Value, named};

named! {
    /// How the camera projects the scene onto the picture.
    ProjectionKind {
        /// Like a photograph.
        Perspective = "perspective",
        /// Without perspective: all lengths at right angles to the view have one scale.
        Orthographic = "orthographic",
        /// All directions around the eye: longitude to the right, latitude upwards.
        Equirectangular = "equirectangular",
    }
}

named! {
    /// The side from which the automatic camera looks.
    AxisView {
        /// Along +y if z is up.
        Front = "front",
        /// Opposite to front.
        Back = "back",
        /// From the left as seen from the front.
        Left = "left",
        /// From the right as seen from the front.
        Right = "right",
        /// Straight down; up in the picture is away from the front.
        Top = "top",
        /// Straight up; up in the picture is towards the front.
        Bottom = "bottom",
        /// Three sides at equal angles.
        Iso = "iso",
        /// From the positive end of the x axis.
        X = "x",
        /// From the negative end of the x axis.
        MinusX = "-x",
        /// From the positive end of the y axis.
        Y = "y",
        /// From the negative end of the y axis.
        MinusY = "-y",
        /// From the positive end of the z axis.
        Z = "z",
        /// From the negative end of the z axis.
        MinusZ = "-z",
    }
}

/// Elevation in degrees at which three axes have equal angles to the view: that of a diagonal of a cube,
/// atan(1/sqrt(2)).
const ISOMETRIC_ELEVATION: f64 = 35.264_389_682_754_654;

impl AxisView {
    /// Azimuth and elevation in degrees; `up` is the direction up in the world.
    pub fn angles(self, up: DVec3) -> [f64; 2] {
        match self {
            Self::X => angles_of(DVec3::X, up),
            Self::MinusX => angles_of(DVec3::NEG_X, up),
            Self::Y => angles_of(DVec3::Y, up),
            Self::MinusY => angles_of(DVec3::NEG_Y, up),
            Self::Z => angles_of(DVec3::Z, up),
            Self::MinusZ => angles_of(DVec3::NEG_Z, up),
            Self::Front => [0.0, 0.0],
            Self::Back => [180.0, 0.0],
            Self::Left => [-90.0, 0.0],
            Self::Right => [90.0, 0.0],
            Self::Top => [0.0, 90.0],
            Self::Bottom => [0.0, -90.0],
            Self::Iso => [45.0, ISOMETRIC_ELEVATION],
        }
    }
}

/// Azimuth and elevation in degrees of a view from the side `from`.
fn angles_of(from: DVec3, up: DVec3) -> [f64; 2] {
    let up = up.normalize_or(DVec3::Z);
    let height = from.dot(up).clamp(-1.0, 1.0);
    if height.abs() > 1.0 - 1e-9 {
        return [0.0, 90.0 * height.signum()];
    }
    // The directions from which azimuths of 0 and 90 degrees look
    let [front, right] = [0.0, 90.0].map(|azimuth| -view_direction(up, azimuth, 0.0));
    let azimuth = libm::atan2(from.dot(right), from.dot(front));
    [azimuth.to_degrees(), libm::asin(height).to_degrees()]
}

impl Camera {
    /// Azimuth and elevation of the automatic camera in degrees; `up` is the direction up in the world.
    pub fn angles(&self, up: DVec3) -> [f64; 2] {
        match self.view {
            Some(view) => view.angles(up),
            // The up direction is undefined for a view straight down; one degree makes no visible difference
            None => [
                self.azimuth.unwrap_or(DEFAULT_AZIMUTH),
                self.elevation.unwrap_or(DEFAULT_ELEVATION).clamp(-89.0, 89.0),
            ],
        }
    }

    /// Number of images beside each other and below each other in a picture.
    pub const fn eyes(&self) -> [u32; 2] {
        match (self.stereo, self.projection) {
            (false, _) => [1, 1],
            (true, ProjectionKind::Equirectangular) => [1, 2],
            (true, _) => [2, 1],
        }
    }
}

/// Where the views of two eyes converge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergenceSetting(pub Convergence);

impl ConvergenceSetting {
    pub(super) const DEFAULT: Self = Self(Convergence::Target);
}

impl Value for ConvergenceSetting {
    const FLAG: FlagKind = FlagKind::NumberOrText;

    fn kind(_: &Key) -> String {
        "a length above 0, \"auto\" or \"parallel\"".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let convergence = match field.as_text() {
            Some("auto") => Some(Convergence::Target),
            Some("parallel") => Some(Convergence::Parallel),
            Some(_) => None,
            None => {
                let distance = field.as_number().filter(|v| *v > 0.0);
                distance.map(Convergence::Distance)
            }
        };
        convergence.map(Self).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        match self.0 {
            Convergence::Target => "\"auto\"".to_owned(),
            Convergence::Parallel => "\"parallel\"".to_owned(),
            Convergence::Distance(distance) => distance.toml(),
        }
    }

    fn schema(_: &Key) -> Json {
        json!({ "anyOf": [
            { "enum": ["auto", "parallel"] },
            { "type": "number", "exclusiveMinimum": 0 },
        ] })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Manifest;

    fn read(rest: &str) -> Result<(Manifest, Vec<String>), String> {
        let text = format!("input.path = \"a\"\n{rest}");
        Manifest::parse_with_warnings(&text, Path::new("job.toml"), Vec::new())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn cameras_have_a_projection() {
        let (plain, _) = read("").unwrap();
        assert_eq!(plain.camera.projection, ProjectionKind::Perspective);
        assert_eq!(plain.camera.angles(DVec3::Z), [DEFAULT_AZIMUTH, DEFAULT_ELEVATION]);
        assert_eq!(plain.picture(), plain.image);
        for (rest, size) in [
            ("projection = \"orthographic\"\nheight = 2", [1920, 1080]),
            ("projection = \"orthographic\"\nheight = \"auto\"\nview = \"top\"", [1920, 1080]),
            ("stereo = true", [3840, 1080]),
            ("stereo = true\neye_distance = 2\nconvergence = \"parallel\"", [3840, 1080]),
            ("stereo = true\nprojection = \"equirectangular\"\neye_distance = 2", [1920, 2160]),
        ] {
            let (manifest, _) = read(&format!("[camera]\n{rest}")).unwrap();
            assert_eq!(manifest.picture().size(), size, "{rest}");
        }
    }

    #[test]
    fn written_manifests_are_read_back() {
        for rest in [
            "projection = \"orthographic\"\nheight = 2\nview = \"iso\"",
            "projection = \"equirectangular\"\nview = \"left\"\nstereo = true\neye_distance = 0.5",
            "stereo = true\nconvergence = 3\n[image]\nwidth = \"85mm\"\ndpi = 90",
        ] {
            let (manifest, _) = read(&format!("[camera]\n{rest}")).unwrap();
            let written = manifest.to_commented_toml();
            let again = Manifest::parse(&written, Path::new("job.toml"));
            assert_eq!(again.as_ref(), Ok(&manifest), "{written}");
        }
    }

    #[test]
    fn panoramas_of_another_shape_are_reported() {
        let panorama = "camera.projection = \"equirectangular\"\n";
        let (_, warnings) = read(panorama).unwrap();
        let expected = "camera.projection: equirectangular pictures are twice as wide as high, but this one is 1920x1080; \
                        --width 2160 --height 1080 makes it so";
        assert!(warnings.len() == 1 && warnings[0].ends_with(expected), "{warnings:?}");
        let (_, warnings) = read(&format!("{panorama}image.width = 2160")).unwrap();
        assert!(warnings.is_empty());
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let (ortho, panorama) =
            ("projection = \"orthographic\"\n", "projection = \"equirectangular\"\n");
        for (rest, part) in [
            (
                "height = 2".to_owned(),
                "camera.height: is given, but only projection = \"orthographic\"",
            ),
            (format!("{ortho}height = 0"), "camera.height: expected a length above 0"),
            (
                format!("{ortho}fov = 30"),
                "camera.fov: is given, but an orthographic picture has a height",
            ),
            (format!("{panorama}fov = 30"), "camera.fov: is given, but an equirectangular picture"),
            (
                format!("{ortho}f_stop = 2"),
                "camera.f_stop: is given, but only perspective has depth of field",
            ),
            (format!("{panorama}aperture = 2"), "camera.aperture: is given, but only perspective"),
            (format!("{panorama}mode = \"turntable\""), "camera.mode: is turntable"),
            (format!("{panorama}elevation = 3"), "camera.elevation: is given, but the horizon"),
            (
                format!("{panorama}view = \"top\""),
                "camera.view: must be front, back, left or right",
            ),
            ("view = \"top\"\nmode = \"turntable\"".to_owned(), "camera.view: is along the axis"),
            (
                "view = \"top\"\nazimuth = 3".to_owned(),
                "camera.view: is given, but so are azimuth or elevation",
            ),
            (
                "view = \"top\"\neye = [1, 2, 3]\nlook_at = [0, 0, 0]".to_owned(),
                "camera.view: is given, but eye and look_at place the camera",
            ),
            ("view = \"topp\"".to_owned(), "did you mean top?"),
            (format!("{ortho}stereo = true"), "camera.stereo: is true, but both eyes see the same"),
            (
                "stereo = true\nf_stop = 2".to_owned(),
                "camera.stereo: is true, but stereo pairs have no depth of field",
            ),
            (
                "eye_distance = 2".to_owned(),
                "camera.eye_distance: is given, but there is only one eye",
            ),
            (
                "convergence = 2".to_owned(),
                "camera.convergence: is given, but there is only one eye",
            ),
            (format!("{panorama}stereo = true"), "camera.eye_distance: is missing"),
            (
                format!("{panorama}stereo = true\neye_distance = 1\nconvergence = 3"),
                "camera.convergence: is given, but the eyes of an equirectangular stereo pair",
            ),
            (
                "stereo = true\n[image]\noverscan = 5".to_owned(),
                "image.overscan: is given, but stereo pairs",
            ),
            (
                "stereo = true\n[image]\ncrop = [0, 0, 9, 9]".to_owned(),
                "image.crop: is given, but stereo pairs",
            ),
            (
                "stereo = true\n[image]\nwidth = 65536".to_owned(),
                "camera.stereo: makes the picture larger",
            ),
            (
                "stereo = true\n[output]\nchannels = [\"motion\"]".to_owned(),
                "output.channels: motion is given, but stereo pairs",
            ),
            (
                format!("{panorama}[[overlay]]\ntype = \"scale_bar\""),
                "overlay: has a scale bar, but an equirectangular picture has no scale",
            ),
            (
                format!(
                    "{ortho}[[camera.key]]\nframe = 1\neye = [1, 2, 3]\nlook_at = [0, 0, 0]\nfov = 3"
                ),
                "camera.key.0.fov: is given, but only perspective",
            ),
        ] {
            let error = read(&format!("[camera]\n{rest}")).unwrap_err();
            assert!(error.contains(part), "{rest}: {error}");
        }
    }
}
