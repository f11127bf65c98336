//! `[[light]]`: light sources. Without any, lights are placed relative to the camera.

use glam::{DVec3, Vec3};
use spherule_tracer::scene::Falloff;

use super::LightGroup;
use super::key::{Affects, Key};
use super::keys::{Keys, keys};
use super::value::{Named, named};

named!(Falloff: None = "none", InverseSquare = "inverse-square");

pub(super) const ABOUT: &[&str] = &[
    "Light sources; without any, whitted has a key light and a soft fill light, placed relative to the camera",
];

/// The key `type`.
#[derive(Clone, Copy, PartialEq)]
enum LightType {
    Point,
    Directional,
    Sun,
    Sphere,
    Rect,
    Disc,
}

named!(
    LightType: Point = "point",
    Directional = "directional",
    Sun = "sun",
    Sphere = "sphere",
    Rect = "rect",
    Disc = "disc"
);

/// Default apparent diameter of a sun in degrees: that of the sun as seen from the earth.
const SUN_SIZE: f64 = 0.53;

/// Kinds of light sources. World coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// A point light.
    Point {
        /// Its position.
        position: DVec3,
        /// Falloff with distance.
        falloff: Falloff,
    },
    /// A light at infinite distance.
    Directional {
        /// Direction in which the light travels; not zero, of any length.
        direction: DVec3,
    },
    /// A light at infinite distance with an angular size.
    Sun {
        /// Direction in which the light travels; not zero, of any length.
        direction: DVec3,
        /// Apparent diameter, degrees.
        size: f64,
    },
    /// A sphere that emits light in all directions.
    Sphere {
        /// Its centre.
        position: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// A rectangle that emits light to one side. Its width is horizontal.
    Rect {
        /// Its centre.
        position: DVec3,
        /// Direction that it faces; not zero, of any length.
        direction: DVec3,
        /// Its width.
        width: f64,
        /// Its height.
        height: f64,
    },
    /// A disc that emits light to one side.
    Disc {
        /// Its centre.
        position: DVec3,
        /// Direction that it faces; not zero, of any length.
        direction: DVec3,
        /// Its radius.
        radius: f64,
    },
}

/// One `[[light]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// The kind of light.
    pub kind: LightKind,
    /// Linear RGB.
    pub color: Vec3,
    /// Factor on the colour.
    pub intensity: f32,
    /// Whether the camera sees a light with an extent.
    pub visible: bool,
    /// Its light group.
    pub group: Option<LightGroup>,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            kind: LightKind::of(LightType::Point),
            color: Vec3::ONE,
            intensity: 1.0,
            visible: false,
            group: None,
        }
    }
}

impl LightKind {
    const fn of(kind: LightType) -> Self {
        match kind {
            LightType::Point => {
                Self::Point { position: DVec3::new(0.0, 0.0, 10.0), falloff: Falloff::None }
            }
            LightType::Directional => Self::Directional { direction: DVec3::NEG_Z },
            LightType::Sun => Self::Sun { direction: DVec3::NEG_Z, size: SUN_SIZE },
            LightType::Sphere => Self::Sphere { position: DVec3::new(0.0, 0.0, 10.0), radius: 1.0 },
            LightType::Rect => Self::Rect {
                position: DVec3::new(0.0, 0.0, 10.0),
                direction: DVec3::NEG_Z,
                width: 2.0,
                height: 1.0,
            },
            LightType::Disc => Self::Disc {
                position: DVec3::new(0.0, 0.0, 10.0),
                direction: DVec3::NEG_Z,
                radius: 1.0,
            },
        }
    }

    const fn light_type(&self) -> LightType {
        match self {
            Self::Point { .. } => LightType::Point,
            Self::Directional { .. } => LightType::Directional,
            Self::Sun { .. } => LightType::Sun,
            Self::Sphere { .. } => LightType::Sphere,
            Self::Rect { .. } => LightType::Rect,
            Self::Disc { .. } => LightType::Disc,
        }
    }

    /// The name of its type in a manifest.
    pub fn type_name(&self) -> &'static str {
        let names = LightType::names();
        let own = names.iter().find(|(kind, _)| *kind == self.light_type());
        own.map_or("", |(_, name)| name)
    }
}

impl Light {
    /// One light of each type.
    pub(super) fn examples() -> Vec<Self> {
        let of_type = |(kind, _)| Self { kind: LightKind::of(kind), ..Self::default() };
        LightType::names().into_iter().map(of_type).collect()
    }

    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        let mut kind = self.kind.light_type();
        let key = Key::new("type", &["point | directional | sun | sphere | rect | disc"]);
        keys.key(key.required("\"point\" or \"directional\", for example"), &mut kind);
        if let Some(section) = keys.reading() {
            // The type determines which keys are known, so the rest is not checked.
            if !section.has("type") {
                section.close();
                return;
            }
            self.kind = LightKind::of(kind);
        }
        match &mut self.kind {
            LightKind::Point { position, falloff } => keys!(keys:
                /// Position of the light
                position => *position, required("a point light needs it, such as [0.0, 0.0, 10.0]");
                /// Falloff with distance: none | inverse-square
                falloff => *falloff;
            ),
            LightKind::Directional { direction } => keys!(keys:
                /// Direction in which the light travels
                direction => *direction, direction(),
                    required("a directional light needs the direction in which it travels, such as [0.0, 0.0, -1.0]");
            ),
            LightKind::Sun { direction, size } => keys!(keys:
                /// Direction in which the light travels
                direction => *direction, direction(),
                    required("a sun needs the direction in which its light travels, such as [0.0, 0.0, -1.0]");
                /// Apparent diameter in degrees; larger makes softer shadows
                size => *size, unit("degrees"), from(0.01), to(90);
            ),
            LightKind::Sphere { position, radius } => keys!(keys:
                /// Centre of the sphere
                position => *position, required("a sphere needs its centre, such as [0.0, 0.0, 10.0]");
                /// Radius of the sphere
                radius => *radius, unit("a length"), above(0), single(),
                    required("a sphere needs its radius, such as 1.0");
            ),
            LightKind::Rect { position, direction, width, height } => {
                flat_keys(position, direction, keys);
                keys!(keys:
                    /// Width of the rectangle, which is horizontal
                    width => *width, unit("a length"), above(0), single(),
                        required("a rectangle needs its width, such as 2.0");
                    /// Height of the rectangle
                    height => *height, unit("a length"), above(0), single(),
                        required("a rectangle needs its height, such as 1.0");
                );
            }
            LightKind::Disc { position, direction, radius } => {
                flat_keys(position, direction, keys);
                keys!(keys:
                    /// Radius of the disc
                    radius => *radius, unit("a length"), above(0), single(),
                        required("a disc needs its radius, such as 1.0");
                );
            }
        }
        keys!(keys:
            /// Colour, linear RGB
            color => self.color;
            /// Factor on the colour
            ///
            /// Colour times intensity is the radiant intensity in W/sr of a point light with falloff, the irradiance
            /// in W/m2 on surfaces that face it of a point light without falloff, a directional light and a sun, and
            /// the radiance in W/(m2 sr) of a sphere, rectangle or disc.
            intensity => self.intensity, from(0);
            /// Light group, for the channel light_groups
            ///
            /// Several lights may be in a group.
            group => self.group, example("\"key\""), unset("light_default, the layer of light without a group"),
                affects(Affects::LightGroups);
        );
        if !matches!(self.kind, LightKind::Point { .. } | LightKind::Directional { .. }) {
            keys!(keys:
                /// Whether the camera sees the light
                visible => self.visible;
            );
        }
    }
}

/// The keys of a light that shines to one side.
fn flat_keys(position: &mut DVec3, direction: &mut DVec3, keys: &mut Keys<'_>) {
    keys!(keys:
        /// Centre of the light
        position => *position, required("the light needs its centre, such as [0.0, 0.0, 10.0]");
        /// Direction that the light faces
        direction => *direction, direction(),
            required("the light needs the direction that it faces, such as [0.0, 0.0, -1.0]");
    );
}
