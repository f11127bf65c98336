//! `[[light]]`: light sources. With none given, lights are placed by the camera.

use glam::{DVec3, Vec3};

use super::key::{Key, Keys, keys};
use super::value::named;
use crate::scene::Falloff;

named!(Falloff: None = "none", InverseSquare = "inverse-square");

pub(super) const ABOUT: &[&str] =
    &["Light sources; without any, a key light and a soft fill are placed by the camera"];

/// `type` in the file.
#[derive(Clone, Copy, PartialEq)]
enum LightType {
    Point,
    Directional,
}

named!(LightType: Point = "point", Directional = "directional");

/// Where light comes from. World coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// From a point, in all directions.
    Point {
        /// The point.
        position: DVec3,
        /// How it fades with distance.
        falloff: Falloff,
    },
    /// From far away.
    Directional {
        /// Direction in which the light travels; not 0, of any length.
        direction: DVec3,
    },
}

/// One `[[light]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Where it comes from.
    pub kind: LightKind,
    /// Linear RGB.
    pub color: Vec3,
    /// Factor on the colour.
    pub intensity: f32,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            kind: LightKind::of(LightType::Point),
            color: Vec3::ONE,
            intensity: 1.0,
        }
    }
}

impl LightKind {
    const fn of(kind: LightType) -> Self {
        match kind {
            LightType::Point => Self::Point {
                position: DVec3::new(0.0, 0.0, 10.0),
                falloff: Falloff::None,
            },
            LightType::Directional => Self::Directional {
                direction: DVec3::NEG_Z,
            },
        }
    }
}

impl Light {
    /// One of every type.
    pub(super) fn examples() -> [Self; 2] {
        [LightType::Point, LightType::Directional].map(|kind| Self {
            kind: LightKind::of(kind),
            ..Self::default()
        })
    }

    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        let mut kind = match self.kind {
            LightKind::Point { .. } => LightType::Point,
            LightKind::Directional { .. } => LightType::Directional,
        };
        let key = Key::new("type", &["point | directional"]);
        keys.key(key.required("\"point\" or \"directional\""), &mut kind);
        if let Some(section) = keys.reading() {
            // Which keys are known depends on the type, so the rest is not judged.
            if !section.has("type") {
                section.close();
                return;
            }
            self.kind = LightKind::of(kind);
        }
        match &mut self.kind {
            LightKind::Point { position, falloff } => keys!(keys:
                /// Position of the light
                position => *position, required("a point light needs it, as [0.0, 0.0, 10.0]");
                /// Falloff with distance: none | inverse-square
                falloff => *falloff;
            ),
            LightKind::Directional { direction } => keys!(keys:
                /// Direction in which the light travels
                direction => *direction, direction(),
                    required("a directional light needs the direction in which it travels, as [0.0, 0.0, -1.0]");
            ),
        }
        keys!(keys:
            /// Colour, linear RGB
            color => self.color;
            /// Factor on the colour
            intensity => self.intensity, from(0);
        );
    }
}
