//! `[[light]]`: what shines. With none given, lights are placed by the camera.

use super::color::rgb;
use super::named;
use super::reader::{Field, Section};
use super::write::Entries;

named! {
    /// How a point light fades.
    Falloff {
        /// Not at all, as in the thesis.
        None = "none",
        /// By the square of the distance.
        InverseSquare = "inverse-square",
    }
}

/// `type` in the file.
#[derive(Clone, Copy)]
enum LightType {
    Point,
    Directional,
}

const LIGHT_TYPES: &[(LightType, &str)] = &[
    (LightType::Point, "point"),
    (LightType::Directional, "directional"),
];

/// Where light comes from. World coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// From a point, in all directions.
    Point {
        /// The point.
        position: [f64; 3],
        /// How it fades with distance.
        falloff: Falloff,
    },
    /// From far away.
    Directional {
        /// The way the light travels; not 0, of any length.
        direction: [f64; 3],
    },
}

/// One `[[light]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Where it comes from.
    pub kind: LightKind,
    /// Linear RGB.
    pub color: [f32; 3],
    /// Factor on the colour.
    pub intensity: f32,
}

impl Light {
    pub(super) fn read(mut section: Section<'_>) -> Option<Self> {
        let kind = section.optional("type", |f| f.choice(LIGHT_TYPES));
        if section.lacks("type") {
            section.missing("type", "\"point\" or \"directional\"");
        }
        let color = section.value("color", [1.0; 3], rgb);
        let intensity = section.value("intensity", 1.0, |f| {
            f.number32("a number from 0", |v| v >= 0.0)
        });
        let kind = match kind {
            Some(LightType::Point) => Self::read_point(&mut section),
            Some(LightType::Directional) => Self::read_directional(&mut section),
            // Which keys are known depends on the type, so the rest is not judged.
            None => return None,
        };
        section.finish();
        Some(Self {
            kind: kind?,
            color,
            intensity,
        })
    }

    fn read_point(section: &mut Section<'_>) -> Option<LightKind> {
        let position = section.optional("position", Field::point);
        let falloff = section.value("falloff", Falloff::None, |f| f.choice(Falloff::ALL));
        if section.lacks("position") {
            section.missing("position", "a point light needs it, as [0.0, 0.0, 10.0]");
        }
        let position = position?;
        Some(LightKind::Point { position, falloff })
    }

    fn read_directional(section: &mut Section<'_>) -> Option<LightKind> {
        let direction = section.optional("direction", Field::direction);
        if section.lacks("direction") {
            section.missing(
                "direction",
                "a directional light needs the way it travels, as [0.0, 0.0, -1.0]",
            );
        }
        direction.map(|direction| LightKind::Directional { direction })
    }

    pub(super) fn entries(&self, index: usize, out: &mut Entries) {
        out.item("light", index);
        match &self.kind {
            LightKind::Point { position, falloff } => {
                out.put("type", "point", "point | directional");
                out.put("position", position, "where");
                out.put("falloff", falloff, "none | inverse-square");
            }
            LightKind::Directional { direction } => {
                out.put("type", "directional", "point | directional");
                out.put("direction", direction, "the way the light travels");
            }
        }
        out.put("color", &self.color, "linear RGB");
        out.put("intensity", &self.intensity, "factor on the colour");
    }
}
