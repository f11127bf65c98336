//! `[[light]]`: light sources. Without any, lights are placed relative to the camera.

use glam::{DVec3, Vec3};

use super::key::{Key, Keys, keys};
use super::value::named;
use crate::scene::Falloff;

named!(Falloff: None = "none", InverseSquare = "inverse-square");

pub(super) const ABOUT: &[&str] = &[
    "Light sources; without any, a key light and a soft fill light are placed relative to the camera",
];

/// The key `type`.
#[derive(Clone, Copy, PartialEq)]
enum LightType {
    Point,
    Directional,
}

named!(LightType: Point = "point", Directional = "directional");

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
    /// One light of each type.
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
        }
        keys!(keys:
            /// Colour, linear RGB
            color => self.color;
            /// Factor on the colour
            intensity => self.intensity, from(0);
        );
    }
}
