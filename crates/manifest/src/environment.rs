//! `[environment]`: light from infinitely far away, for the path integrator.

use glam::Vec3;

use super::LightGroup;
use super::key::{Affects, Key};
use super::keys::{Keys, keys};
use super::reader::Section;
use super::rule::{Rule, rules};
use super::sun::Sun;
use super::value::named;

named! {
    /// Source of the radiance of the environment.
    EnvironmentKind {
        /// A soft key light, a fill light, a rim light and a dome, placed relative to the first view of the camera.
        Studio = "studio",
        /// A clear sky with its sun.
        Sky = "sky",
        /// An equirectangular image.
        Image = "image",
        /// The same radiance from every direction.
        Constant = "constant",
    }
}

named! {
    /// What becomes of suns in an image of the environment.
    ExtractSun {
        /// They are lights.
        Auto = "auto",
        /// They stay in the image.
        Off = "off",
    }
}

pub(super) const ABOUT: &[&str] = &["Light from infinitely far away, for integrator = \"path\""];

/// The comment of `type`.
const TYPE: &str = "Source: studio (soft key light, fill, rim and dome) | sky | image | constant";

/// `[environment]`
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    /// Source of the radiance.
    pub kind: EnvironmentKind,
    /// The sun of a sky.
    pub sun: Sun,
    /// The haze in the air of a sky: 2 is very clear, 10 hazy.
    pub turbidity: f32,
    /// Reflectance of the ground that lights a sky.
    pub albedo: f32,
    /// Path of the image, if that is the source.
    pub image: Option<String>,
    /// What becomes of suns in the image.
    pub extract_sun: ExtractSun,
    /// Whether the camera, mirrors and clear bodies see the image at its own resolution.
    pub detail: bool,
    /// Factor on the radiance, linear RGB.
    pub color: Vec3,
    /// Factor on the radiance.
    pub intensity: f32,
    /// Rotation around the up axis, counterclockwise as seen from above, degrees.
    pub rotation: f64,
    /// Whether camera rays see the environment instead of the background.
    pub visible: bool,
    /// Its light group.
    pub group: Option<LightGroup>,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            kind: EnvironmentKind::Studio,
            sun: Sun::DEFAULT,
            turbidity: 1.5,
            albedo: 0.2,
            image: None,
            extract_sun: ExtractSun::Auto,
            detail: true,
            color: Vec3::ONE,
            intensity: 1.0,
            rotation: 0.0,
            visible: false,
            group: None,
        }
    }
}

/// Rules between the keys.
pub(super) const RULES: &[Rule] = rules! {
    "type" Is["image"] => "image" Given: "type = \"image\" needs a file, as \"hall.exr\"";
    "type" IsNot["image"] => "image" Missing: "is given, but only type = \"image\" uses it";
};

impl Environment {
    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        let key = Key::new("type", &[TYPE]).affects(Affects::PathTracing);
        keys.key(key, &mut self.kind);
        keys!(keys:
            /// sky: position of the sun and its apparent diameter, degrees
            ///
            /// The elevation is above the horizon, from -12 (the end of a dusk) to 90. The azimuth is 0 at the right
            /// of the first view of the camera, and 90 on the viewer's side. A size of 0.53 is that of the sun as seen
            /// from the earth; a larger one has softer shadows.
            sun => self.sun, affects(Affects::PathTracing);
            /// sky: haze in the air, 1 (none) to 10; 1.5 is a very clear day, 2.5 a usual one
            turbidity => self.turbidity, from(1), to(10), affects(Affects::Sky);
            /// sky: reflectance of the ground around, which lights the sky
            albedo => self.albedo, from(0), to(1), affects(Affects::Sky);
            /// image: an equirectangular OpenEXR or Radiance HDR file
            image => self.image, example("\"hall.exr\""), affects(Affects::PathTracing);
            /// image: whether suns in it are lights, with sharp shadows and caustics: auto | off
            ///
            /// auto takes up to four small places with much of the light out of the image. Each becomes a light of the same
            /// direction, size and irradiance, which a note states.
            extract_sun => self.extract_sun, affects(Affects::EnvironmentImage);
            /// image: whether the camera, mirrors and clear bodies see it at its own resolution, not at 512x256
            detail => self.detail, affects(Affects::EnvironmentImage);
            /// Factor on the radiance, linear RGB; the radiance of a constant environment
            color => self.color, affects(Affects::PathTracing);
            /// Factor on the radiance; 0 is no light
            intensity => self.intensity, from(0), affects(Affects::PathTracing);
            /// Rotation around the up axis, counterclockwise from above, degrees
            ///
            /// At 0, the centre of an image is where a camera with azimuth 0 looks. A studio and a sky turn relative to
            /// the first view of the camera.
            rotation => self.rotation, unit("degrees"), affects(Affects::PathTracing);
            /// Whether the camera sees the environment instead of render.background
            visible => self.visible, affects(Affects::PathTracing);
            /// Light group, for the channel light_groups; the sun of a sky belongs to it
            group => self.group, example("\"sky\""), unset("light_default, the layer of light without a group"),
                affects(Affects::LightGroups);
        );
        if let Some(section) = keys.reading() {
            self.check(section);
        }
    }

    /// Without a type, an image is the source.
    fn check(&mut self, section: &Section<'_>) {
        if section.lacks("type") && self.image.is_some() {
            self.kind = EnvironmentKind::Image;
        }
        section.check(RULES);
    }
}
