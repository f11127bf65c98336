//! Colours: constant ones, and those from an attribute of the particles, possibly through a map.

use glam::Vec3;
use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::nearest::nearest;
use super::value::{Fault, Value, numbers_schema, quoted};
use crate::scene::Background;

/// Source of the colours of particles.
#[derive(Debug, Clone, PartialEq)]
pub enum ColorSetting {
    /// By speed if the particles have velocities, otherwise their own colours, otherwise one colour.
    Auto,
    /// By speed, with a map or range that is not the default.
    AutoWith {
        /// The map; by default [`DEFAULT_MAP`].
        map: Option<MapName>,
        /// Values at the two ends of the map; by default the range of the whole sequence.
        range: Option<[f64; 2]>,
    },
    /// Linear RGB, the same for all particles.
    Rgb(Vec3),
    /// An attribute: colours are used as they are unless a map or a range is given. All other values are mapped,
    /// vectors by their length.
    Attribute {
        /// Name of the attribute.
        attribute: String,
        /// The map; by default [`DEFAULT_MAP`].
        map: Option<MapName>,
        /// Values at the two ends of the map; by default the range of the whole sequence.
        range: Option<[f64; 2]>,
    },
}

/// Available colour maps, by the names of [`crate::scene::ColorMap`].
pub const COLOR_MAPS: [&str; 8] = [
    "viridis", "turbo", "plasma", "inferno", "magma", "cividis", "red-blue", "greys",
];

/// The default map.
pub const DEFAULT_MAP: MapName = MapName(COLOR_MAPS[0]);

/// One of [`COLOR_MAPS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MapName(&'static str);

impl MapName {
    /// The map with a name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        let known = COLOR_MAPS.into_iter().find(|known| *known == name);
        known.map(Self)
    }

    /// The name in a manifest.
    pub const fn name(self) -> &'static str {
        self.0
    }
}

impl Value for MapName {
    fn kind(_: &Key) -> String {
        "a colour map".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        Self::named(text).ok_or_else(|| {
            let hint = nearest(text, &COLOR_MAPS).map(|n| format!("; did you mean {n}?"));
            Fault::Because(format!(
                "unknown colour map `{text}`; choose one of {}{}",
                COLOR_MAPS.join(", "),
                hint.unwrap_or_default()
            ))
        })
    }

    fn toml(&self) -> String {
        quoted(self.0)
    }

    fn schema(_: &Key) -> Json {
        json!({ "enum": COLOR_MAPS })
    }
}

/// The ends of a colour map.
impl Value for [f64; 2] {
    fn kind(_: &Key) -> String {
        "two rising numbers, such as [0.0, 4.0]".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let range = field.as_numbers().filter(|[low, high]: &Self| low < high);
        range.ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        format!("[{:?}, {:?}]", self[0], self[1])
    }

    fn schema(_: &Key) -> Json {
        numbers_schema(2)
    }
}

impl Value for ColorSetting {
    fn kind(_: &Key) -> String {
        "three numbers from 0, such as [0.6, 0.7, 0.9], { attribute = \"velocity\", map = \"viridis\" }, or \"auto\""
            .to_owned()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if field.as_text() == Some("auto") {
            return Ok(Self::Auto);
        }
        let Some(mut section) = field.as_table() else {
            return Vec3::parse(field, key).map(Self::Rgb);
        };
        let lacks = |key| section.lacks(key);
        let is_auto = lacks("attribute") && !(lacks("map") && lacks("range"));
        let (mut attribute, mut map, mut range) = (String::new(), None, None);
        let mut name = Key::new("attribute", &[]);
        if !is_auto {
            name = name.required("the name of an attribute, such as \"velocity\"");
        }
        section.read(&name, &mut attribute);
        section.read(&Key::new("map", &[]), &mut map);
        section.read(&Key::new("range", &[]), &mut range);
        section.finish();
        Ok(match is_auto {
            true => Self::AutoWith { map, range },
            false => Self::Attribute {
                attribute,
                map,
                range,
            },
        })
    }

    fn toml(&self) -> String {
        let (attribute, map, range) = match self {
            Self::Auto => return quoted("auto"),
            Self::Rgb(rgb) => return rgb.toml(),
            Self::AutoWith { map, range } => (None, map, range),
            Self::Attribute {
                attribute,
                map,
                range,
            } => (Some(attribute), map, range),
        };
        let pairs = [
            attribute.map(|attribute| format!("attribute = {}", attribute.toml())),
            map.map(|map| format!("map = {}", map.toml())),
            range.map(|range| format!("range = {}", range.toml())),
        ];
        let pairs: Vec<String> = pairs.into_iter().flatten().collect();
        format!("{{ {} }}", pairs.join(", "))
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [
            { "const": "auto" },
            Vec3::schema(key),
            {
                "type": "object",
                "properties": {
                    "attribute": String::schema(key),
                    "map": MapName::schema(key),
                    "range": <[f64; 2]>::schema(key),
                },
                "minProperties": 1,
                "additionalProperties": false,
            },
        ] })
    }
}

/// Name of the background of a photo studio.
const STUDIO: &str = "studio";

/// The up direction is set by [`Background::with_up`].
impl Value for Background {
    fn kind(_: &Key) -> String {
        "three numbers from 0, such as [0.1, 0.1, 0.1], { bottom = [...], top = [...] }, \"studio\""
            .to_owned()
    }

    fn words() -> Vec<&'static str> {
        vec![STUDIO]
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        if field.as_text() == Some(STUDIO) {
            return Ok(Self::Studio { up: Vec3::Z });
        }
        let Some(mut section) = field.as_table() else {
            return Vec3::parse(field, key).map(Self::Constant);
        };
        let (mut bottom, mut top) = (Vec3::ZERO, Vec3::ZERO);
        for (name, color) in [("bottom", &mut bottom), ("top", &mut top)] {
            let key = Key::new(name, &[]).required("three numbers from 0, such as [0.1, 0.1, 0.1]");
            section.read(&key, color);
        }
        section.finish();
        let up = Vec3::Z;
        Ok(Self::Gradient { bottom, top, up })
    }

    fn toml(&self) -> String {
        match self {
            Self::Constant(rgb) => rgb.toml(),
            Self::Gradient { bottom, top, .. } => {
                format!("{{ bottom = {}, top = {} }}", bottom.toml(), top.toml())
            }
            Self::Studio { .. } => quoted(STUDIO),
        }
    }

    fn schema(key: &Key) -> Json {
        let rgb = Vec3::schema(key);
        json!({ "anyOf": [
            rgb,
            {
                "type": "object",
                "properties": { "bottom": rgb, "top": rgb },
                "required": ["bottom", "top"],
                "additionalProperties": false,
            },
            { "const": STUDIO },
        ] })
    }
}
