//! `material.opacity`: how much each sphere covers of what is behind it.

use serde_json::{Value as Json, json};
use spherule_tree::math::narrow;

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value, numbers_schema};

/// How much each sphere covers.
#[derive(Debug, Clone, PartialEq)]
pub enum OpacitySetting {
    /// The same for all, 0 to 1.
    Constant(f32),
    /// By a value of each particle.
    Attribute {
        /// Name of the value.
        attribute: String,
        /// The values with opacity 0 and 1.
        range: [f64; 2],
    },
}

impl Value for OpacitySetting {
    const FLAG: FlagKind = FlagKind::Toml;

    fn kind(_: &Key) -> String {
        "a number from 0 to 1, or { attribute = \"density\", range = [990.0, 1010.0] }".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let Some(mut section) = field.as_table() else {
            let number = field.as_number().filter(|v| (0.0..=1.0).contains(v)).map(narrow);
            return number.map(Self::Constant).ok_or(Fault::Unwanted);
        };
        let (mut attribute, mut range) = (String::new(), Ends([0.0, 1.0]));
        let name = Key::new("attribute", &[]).required("the name of a value, such as \"density\"");
        section.read(&name, &mut attribute);
        let ends = Key::new("range", &[]).required("the values with opacity 0 and 1");
        section.read(&ends, &mut range);
        section.finish();
        Ok(Self::Attribute { attribute, range: range.0 })
    }

    fn toml(&self) -> String {
        match self {
            Self::Constant(opacity) => opacity.toml(),
            Self::Attribute { attribute, range: [low, high] } => {
                let attribute = attribute.toml();
                format!("{{ attribute = {attribute}, range = [{low:?}, {high:?}] }}")
            }
        }
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [
            { "type": "number", "minimum": 0, "maximum": 1 },
            {
                "type": "object",
                "properties": { "attribute": String::schema(key), "range": Ends::schema(key) },
                "required": ["attribute", "range"],
                "additionalProperties": false,
            },
        ] })
    }
}

/// The ends of a range, which may fall.
struct Ends([f64; 2]);

impl Value for Ends {
    fn kind(_: &Key) -> String {
        "two different numbers, such as [990.0, 1010.0]".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let ends = field.as_numbers().filter(|[a, b]| a != b);
        ends.map(Self).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        format!("{:?}", self.0)
    }

    fn schema(_: &Key) -> Json {
        numbers_schema(2)
    }
}
