//! Colours: plain ones, and those that an attribute of the particles gives through a map.

use super::named;
use super::reader::{Field, Section, narrow};
use super::schema::{name_schema, rgb_schema, words};
use super::write::{Toml, described};

named! {
    /// Colour maps by name; the renderer knows what they look like.
    ColorMap {
        /// Dark violet to yellow, even in lightness.
        Viridis = "viridis",
        /// The rainbow, evened out.
        Turbo = "turbo",
        /// Blue to yellow through red.
        Plasma = "plasma",
        /// Black to pale yellow through red.
        Inferno = "inferno",
        /// Black to pale pink through violet.
        Magma = "magma",
        /// Blue to yellow, the same to colour-blind eyes.
        Cividis = "cividis",
        /// Blue to red through white, for values around a middle.
        RedBlue = "red-blue",
        /// Black to white.
        Greys = "greys",
    }
}

/// Where a particle's colour comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum ColorSetting {
    /// By speed where the particles have velocities, else their own colours, else one colour.
    Auto,
    /// By speed, through a map that is not the usual one.
    AutoWith {
        /// The map; None is the usual one.
        map: Option<ColorMap>,
        /// Values at the two ends of the map; None is what the whole sequence has.
        range: Option<[f64; 2]>,
    },
    /// Linear RGB, the same for all.
    Rgb([f32; 3]),
    /// An attribute: colours as they are unless a map or a range is given, anything else through a map,
    /// vectors by their length.
    Attribute {
        /// Name of the attribute.
        attribute: String,
        /// The map; None is viridis.
        map: Option<ColorMap>,
        /// Values at the two ends of the map; None is what the whole sequence has.
        range: Option<[f64; 2]>,
    },
}

/// What rays see that meet nothing. Linear RGB.
#[derive(Debug, Clone, PartialEq)]
pub enum Background {
    /// A calm gradient.
    Auto,
    /// One colour.
    Plain([f32; 3]),
    /// From straight down to straight up.
    Gradient {
        /// Straight down.
        bottom: [f32; 3],
        /// Straight up.
        top: [f32; 3],
    },
}

/// Linear RGB: three numbers from 0.
pub(super) fn rgb(field: &Field<'_>) -> Option<[f32; 3]> {
    field.or_wants(as_rgb(field), "three numbers from 0, as [0.6, 0.7, 0.9]")
}

/// The same, up to 1.
pub(super) fn rgb_to_1(field: &Field<'_>) -> Option<[f32; 3]> {
    let color = as_rgb(field).filter(|color| color.iter().all(|c| *c <= 1.0));
    field.or_wants(color, "three numbers from 0 to 1, as [0.6, 0.9, 0.95]")
}

fn as_rgb(field: &Field<'_>) -> Option<[f32; 3]> {
    let color = field.as_numbers::<3>()?.map(narrow);
    let holds = |c: &f32| c.is_finite() && *c >= 0.0;
    color.iter().all(holds).then_some(color)
}

impl ColorSetting {
    pub(super) fn read(field: &Field<'_>) -> Option<Self> {
        if field.as_text() == Some("auto") {
            return Some(Self::Auto);
        }
        if !field.is_table() {
            let rgb = as_rgb(field).map(Self::Rgb);
            return field.or_wants(
                rgb,
                "three numbers from 0, as [0.6, 0.7, 0.9], { attribute = \"velocity\", map = \"viridis\" }, or \"auto\"",
            );
        }
        let mut section = field.section()?;
        let is_auto =
            section.lacks("attribute") && !(section.lacks("map") && section.lacks("range"));
        let attribute = section.optional("attribute", Field::name);
        let map = section.optional("map", |f| f.choice_of("colour map", ColorMap::ALL));
        let range = section.optional("range", |f| {
            let range = f.as_numbers::<2>().filter(|[low, high]| low < high);
            f.or_wants(range, "two rising numbers, as [0.0, 4.0]")
        });
        if section.lacks("attribute") && !is_auto {
            section.missing("attribute", "the name of an attribute, as \"velocity\"");
        }
        section.finish();
        if is_auto {
            return Some(Self::AutoWith { map, range });
        }
        Some(Self::Attribute {
            attribute: attribute?,
            map,
            range,
        })
    }
}

impl Toml for ColorSetting {
    fn toml(&self) -> String {
        match self {
            Self::Auto => "auto".toml(),
            Self::Rgb(rgb) => rgb.toml(),
            Self::AutoWith { map, range } => {
                format!("{{ {} }}", mapping(*map, *range).trim_start_matches(", "))
            }
            Self::Attribute {
                attribute,
                map,
                range,
            } => {
                format!(
                    "{{ attribute = {}{} }}",
                    attribute.toml(),
                    mapping(*map, *range)
                )
            }
        }
    }
}

/// The keys of a map, each after a comma.
fn mapping(map: Option<ColorMap>, range: Option<[f64; 2]>) -> String {
    let map = map.map_or(String::new(), |m| format!(", map = {}", m.toml()));
    let range = range.map_or(String::new(), |r| format!(", range = {}", r.toml()));
    map + &range
}

described!(ColorSetting, {
    "anyOf": [
        { "const": "auto" },
        rgb_schema(),
        {
            "type": "object",
            "properties": {
                "attribute": name_schema(),
                "map": { "enum": words(&[], ColorMap::ALL) },
                "range": { "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 },
            },
            "minProperties": 1,
            "additionalProperties": false,
        },
    ],
});

impl Background {
    pub(super) fn read(field: &Field<'_>) -> Option<Self> {
        if field.as_text() == Some("auto") {
            return Some(Self::Auto);
        }
        if !field.is_table() {
            let plain = as_rgb(field).map(Self::Plain);
            return field.or_wants(
                plain,
                "three numbers from 0, as [0.1, 0.1, 0.1], { bottom = [...], top = [...] }, or \"auto\"",
            );
        }
        let mut section: Section<'_> = field.section()?;
        let bottom = section.optional("bottom", rgb);
        let top = section.optional("top", rgb);
        for key in ["bottom", "top"] {
            if section.lacks(key) {
                section.missing(key, "three numbers from 0, as [0.1, 0.1, 0.1]");
            }
        }
        section.finish();
        Some(Self::Gradient {
            bottom: bottom?,
            top: top?,
        })
    }
}

impl Toml for Background {
    fn toml(&self) -> String {
        match self {
            Self::Auto => "auto".toml(),
            Self::Plain(rgb) => rgb.toml(),
            Self::Gradient { bottom, top } => {
                format!("{{ bottom = {}, top = {} }}", bottom.toml(), top.toml())
            }
        }
    }
}

described!(Background, {
    "anyOf": [
        { "const": "auto" },
        rgb_schema(),
        {
            "type": "object",
            "properties": { "bottom": rgb_schema(), "top": rgb_schema() },
            "required": ["bottom", "top"],
            "additionalProperties": false,
        },
    ],
});
