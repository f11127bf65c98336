//! Colours: constant ones, and those from values of the particles, possibly through a map.

use glam::Vec3;
use serde_json::{Value as Json, json};
use spherule_tracer::scene::{Background, ColorMap};

use super::by_integer::ByInteger;
use super::color_map::{MapName, RangeSetting};
use super::field::Field;
use super::key::Key;
use super::rule::{Rule, conditions, rules};
use super::tree::Kind;
use super::value::{Fault, FlagKind, Slot, Value, named, quoted};

/// The word for colours by speed, or those of the particles.
const AUTO: &str = "auto";

/// The word for the colours of chemical elements.
const ELEMENTS: &str = "elements";

/// The attribute with the atomic numbers of particles.
pub(super) const ELEMENT: &str = "element";

/// Source of the colours of particles.
#[derive(Debug, Clone, PartialEq)]
pub enum ColorSetting {
    /// By speed if the particles have velocities, otherwise their own colours, otherwise one colour.
    Auto,
    /// Linear RGB, the same for all particles.
    Rgb(Vec3),
    /// By a value of each particle.
    Mapped(ColorMapping),
}

named! {
    /// Scales of colour maps.
    ScaleKind {
        /// Equal differences have equal lengths.
        Linear = "linear",
        /// Equal ratios have equal lengths.
        Log = "log",
        /// Linear around zero, logarithmic beyond.
        SymLog = "symlog",
        /// A colour for each integer.
        Categorical = "categorical",
    }
}

impl ScaleKind {
    /// The names of all scales.
    pub fn all() -> Vec<&'static str> {
        Self::words()
    }
}

/// Colours from a value of each particle. Attributes with colours are used as they are unless another key is given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColorMapping {
    /// The value: an attribute, which is mapped by its length if it is a vector, a component such as `velocity.x`, or
    /// `x`, `height`, `depth`, `index` or `radius`. By default the velocity.
    pub attribute: Option<String>,
    /// The map; the default depends on scale and range.
    pub map: Option<MapName>,
    /// Values at the two ends of the map; by default the range of the whole sequence.
    pub range: Option<RangeSetting>,
    /// The scale; by default linear.
    pub scale: Option<ScaleKind>,
    /// Where the linear part of [`ScaleKind::SymLog`] ends; by default a hundredth of the largest value of the range.
    pub threshold: Option<f64>,
    /// Whether the map is reversed.
    pub reverse: Option<bool>,
    /// Number of colours of a discrete map.
    pub steps: Option<u32>,
    /// Names of categories.
    pub names: Option<CategoryNames>,
    /// Colours of categories, linear RGB.
    pub values: Option<CategoryColors>,
}

/// Names of categories, with their values.
pub type CategoryNames = ByInteger<String>;

/// Colours of categories, with their values.
pub type CategoryColors = ByInteger<Vec3>;

impl ColorMapping {
    /// Colours by this attribute, with defaults for the rest.
    pub fn by(attribute: &str) -> Self {
        Self { attribute: Some(attribute.to_owned()), ..Self::default() }
    }

    /// The colours of chemical elements.
    pub fn elements() -> Self {
        Self {
            map: Some(MapName::ELEMENTS),
            scale: Some(ScaleKind::Categorical),
            ..Self::by(ELEMENT)
        }
    }

    /// The scale.
    pub fn scale(&self) -> ScaleKind {
        match (self.scale, &self.values) {
            (Some(scale), _) => scale,
            (None, Some(_)) => ScaleKind::Categorical,
            (None, None) => ScaleKind::Linear,
        }
    }

    /// Whether nothing but the attribute is given.
    pub fn is_plain(&self) -> bool {
        let plain = Self { attribute: self.attribute.clone(), ..Self::default() };
        *self == plain
    }

    /// The map, reversed if [`Self::reverse`] is set.
    pub fn map(&self) -> MapName {
        let map = self.map.unwrap_or(match (self.scale(), self.range) {
            (ScaleKind::Categorical, _) => MapName::PALETTE,
            (_, Some(RangeSetting::Symmetric)) => MapName::DIVERGING,
            _ => MapName::DEFAULT,
        });
        match self.reverse {
            Some(true) => map.reversed(),
            _ => map,
        }
    }

    /// What the rules between keys do not cover: the key, and the problem.
    fn contradiction(&self) -> Option<(&'static str, String)> {
        let scale = self.scale();
        match (scale, self.range) {
            (ScaleKind::Log, Some(RangeSetting::Values([low, _]))) if low <= 0.0 => {
                let what =
                    format!("{low:?} has no logarithm; begin above 0, or set scale = \"symlog\"");
                Some(("range", what))
            }
            _ if scale != ScaleKind::Categorical && self.map.is_some_and(MapName::is_palette) => {
                Some(("map", "a palette needs scale = \"categorical\"".to_owned()))
            }
            _ => None,
        }
    }
}

const NEED_CATEGORIES: &str = "only categories have names; set scale = \"categorical\"";

/// Rules between the keys of a mapping. Without a scale, `values` are the colours of categories.
pub(super) const RULES: &[Rule] = rules! {
    "scale" Is["log"] => "range" MissingOrNot["symmetric"]:
        "a symmetric range has values below 0, which have no logarithm; set scale = \"symlog\"";
    "scale" IsNot["categorical"] => "names" Missing: NEED_CATEGORIES;
    "scale" Missing, "values" Missing => "names" Missing: NEED_CATEGORIES;
    "scale" Is["categorical"] => "range" Missing: "categories have no range";
    "scale" Missing, "values" Given => "range" Missing: "categories have no range";
    "scale" Is["categorical"] => "steps" Missing: "categories have no steps";
    "scale" Missing, "values" Given => "steps" Missing: "categories have no steps";
    "scale" IsNot["categorical"] => "values" Missing:
        "only categories have colours one by one; set scale = \"categorical\"";
    "values" Given => "map" Missing: "the colours are in `values`; leave one of the two out";
    "scale" MissingOrNot["symlog"] => "threshold" Missing: "only scale = \"symlog\" has it";
};

impl Value for ColorSetting {
    const FLAG: FlagKind = FlagKind::Toml;

    fn kind(key: &Key) -> String {
        let color = Vec3::kind(key);
        format!(
            "{color}, {{ attribute = \"velocity\", map = \"viridis\" }}, \"elements\", or \"auto\""
        )
    }

    fn words() -> Vec<&'static str> {
        [vec![AUTO, ELEMENTS], Vec3::words()].concat()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        // Words and colours come without a table
        match field.as_text() {
            Some(AUTO) => return Ok(Self::Auto),
            Some(ELEMENTS) => return Ok(Self::Mapped(ColorMapping::elements())),
            _ => {}
        }
        let Some(mut section) = field.as_table() else {
            return Vec3::parse(field, key).map(Self::Rgb);
        };
        // Read the table
        let mut by = ColorMapping::default();
        let mut attribute = Key::new("attribute", &[]);
        if matches!(&field.node.kind, Kind::Table(table) if table.is_empty()) {
            attribute = attribute.required("the name of an attribute, such as \"velocity\"");
        }
        section.read(&attribute, &mut by.attribute);
        section.read(&Key::new("map", &[]), &mut by.map);
        section.read(&Key::new("range", &[]), &mut by.range);
        section.read(&Key::new("scale", &[]), &mut by.scale);
        section.read(&threshold_key(), &mut by.threshold);
        section.read(&Key::new("reverse", &[]), &mut by.reverse);
        section.read(&steps_key(), &mut by.steps);
        section.read(&Key::new("names", &[]), &mut by.names);
        section.read(&Key::new("values", &[]), &mut by.values);
        // Check its keys together
        section.check(RULES);
        if let Some((key, what)) = by.contradiction() {
            section.wrong(key, &what);
        }
        section.finish();
        Ok(Self::Mapped(by))
    }

    fn toml(&self) -> String {
        // Write a word where one says the same
        let by = match self {
            Self::Auto => return quoted(AUTO),
            Self::Rgb(rgb) => return rgb.toml(),
            Self::Mapped(by) if *by == ColorMapping::elements() => return quoted(ELEMENTS),
            Self::Mapped(by) => by,
        };
        fn pair<S: Slot>(key: &str, slot: &S) -> Option<String> {
            slot.get().map(|value| format!("{key} = {}", value.toml()))
        }
        // Write the keys that are given
        let pairs: Vec<String> = [
            pair("attribute", &by.attribute),
            pair("map", &by.map),
            pair("range", &by.range),
            pair("scale", &by.scale),
            pair("threshold", &by.threshold),
            pair("reverse", &by.reverse),
            pair("steps", &by.steps),
            pair("names", &by.names),
            pair("values", &by.values),
        ]
        .into_iter()
        .flatten()
        .collect();
        format!("{{ {} }}", pairs.join(", "))
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [
            { "enum": [AUTO, ELEMENTS] },
            Vec3::schema(key),
            {
                "type": "object",
                "properties": {
                    "attribute": String::schema(key),
                    "map": MapName::schema(key),
                    "range": RangeSetting::schema(key),
                    "scale": ScaleKind::schema(key),
                    "threshold": f64::schema(&threshold_key()),
                    "reverse": bool::schema(key),
                    "steps": u32::schema(&steps_key()),
                    "names": CategoryNames::schema(key),
                    "values": CategoryColors::schema(key),
                },
                "minProperties": 1,
                "allOf": conditions(RULES),
                "additionalProperties": false,
            },
        ] })
    }
}

fn threshold_key() -> Key {
    Key::new("threshold", &[]).above(0)
}

fn steps_key() -> Key {
    Key::new("steps", &[]).from(2).to(ColorMap::MAX_STEPS)
}

/// Name of the background of a photo studio.
const STUDIO: &str = "studio";

/// The up direction is set by [`Background::with_up`].
impl Value for Background {
    const FLAG: FlagKind = FlagKind::Toml;

    fn kind(key: &Key) -> String {
        let color = Vec3::kind(key);
        format!("{color}, {{ bottom = \"white\", top = \"skyblue\" }}, or \"studio\"")
    }

    fn words() -> Vec<&'static str> {
        [vec![STUDIO], Vec3::words()].concat()
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
            let key =
                Key::new(name, &[]).required("a colour, such as \"white\" or [0.1, 0.1, 0.1]");
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
