//! Tables with a value for each of some integers, such as `{ 1 = "water", 2 = "sand" }`.

use glam::Vec3;
use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::tree::Kind;
use super::value::{Fault, Value, quoted};

/// Integers with their values, rising.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ByInteger<T>(pub Vec<(i64, T)>);

/// A type of the values of such a table.
pub(super) trait TableValue: Sized {
    /// Description of the table.
    const KIND: &str;

    fn parse(field: &Field<'_>) -> Option<Self>;

    fn toml(&self) -> String;

    fn schema() -> Json;
}

impl<T: TableValue> Value for ByInteger<T> {
    fn kind(_: &Key) -> String {
        T::KIND.to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let Kind::Table(table) = &field.node.kind else {
            return Err(Fault::Unwanted);
        };
        let pair = |(integer, (_, node)): (&String, &(_, _))| {
            let value = T::parse(&Field {
                key: format!("{}.{integer}", field.key),
                node,
                problems: field.problems,
            })?;
            let number: i64 = integer.parse().ok()?;
            // Only one way to write each integer, so that no two keys mean the same
            (number.to_string() == *integer).then_some((number, value))
        };
        let found: Option<Vec<(i64, T)>> = table.iter().map(pair).collect();
        let mut pairs = found.ok_or(Fault::Unwanted)?;
        pairs.sort_unstable_by_key(|(integer, _)| *integer);
        Ok(Self(pairs))
    }

    fn toml(&self) -> String {
        let pairs = self.0.iter().map(|(integer, value)| format!("{integer} = {}", value.toml()));
        format!("{{ {} }}", pairs.collect::<Vec<_>>().join(", "))
    }

    fn schema(_: &Key) -> Json {
        json!({
            "type": "object",
            "patternProperties": { "^(0|-?[1-9][0-9]{0,17})$": T::schema() },
            "additionalProperties": false,
        })
    }
}

impl TableValue for String {
    const KIND: &str = "names of integers, such as { 1 = \"water\", 2 = \"sand\" }";

    fn parse(field: &Field<'_>) -> Option<Self> {
        field.as_text().map(str::to_owned)
    }

    fn toml(&self) -> String {
        quoted(self)
    }

    fn schema() -> Json {
        json!({ "type": "string" })
    }
}

/// Radii.
impl TableValue for f64 {
    const KIND: &str = "lengths above 0 of integers, such as { 1 = 0.5, 2 = 0.7 }";

    fn parse(field: &Field<'_>) -> Option<Self> {
        field.as_number().filter(|length| *length > 0.0)
    }

    fn toml(&self) -> String {
        Value::toml(self)
    }

    fn schema() -> Json {
        json!({ "type": "number", "exclusiveMinimum": 0 })
    }
}

/// Colours.
impl TableValue for Vec3 {
    const KIND: &str = "colours of integers, such as { 1 = \"orange\", 2 = [0.1, 0.3, 0.8] }";

    fn parse(field: &Field<'_>) -> Option<Self> {
        Value::parse(field, &Key::new("values", &[])).ok()
    }

    fn toml(&self) -> String {
        Value::toml(self)
    }

    fn schema() -> Json {
        <Self as Value>::schema(&Key::new("values", &[]))
    }
}
