//! Numbers, times and vectors.

use std::time::Duration;

use glam::DVec3;
use serde_json::{Value as Json, json};
use spherule_tree::math::narrow;

use super::{Fault, FlagKind, Value, list};
use crate::field::Field;
use crate::key::Key;

impl Value for u32 {
    const FLAG: FlagKind = FlagKind::Integer;

    fn kind(key: &Key) -> String {
        format!("a whole number{}", key.range())
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let value = field.as_integer().and_then(|i| Self::try_from(i).ok());
        let in_range = value.filter(|v| key.holds(f64::from(*v)));
        in_range.ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        self.to_string()
    }

    fn schema(key: &Key) -> Json {
        number_schema("integer", key)
    }
}

impl Value for i64 {
    fn kind(_: &Key) -> String {
        "a frame number".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        field.as_integer().ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        self.to_string()
    }

    fn schema(key: &Key) -> Json {
        number_schema("integer", key)
    }
}

impl Value for f64 {
    const FLAG: FlagKind = FlagKind::Number;

    fn kind(key: &Key) -> String {
        let zero = if key.or_zero { "0, or " } else { "" };
        format!("{zero}{}{}", key.unit.unwrap_or("a number"), key.range())
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let holds = |v: &Self| key.holds(*v) && (!key.is_single || key.holds(narrow(*v).into()));
        field.as_number().filter(holds).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        format!("{self:?}")
    }

    fn schema(key: &Key) -> Json {
        let mut schema = number_schema("number", key);
        if key.is_single && key.high.is_none() {
            schema["maximum"] = json!(f32::MAX);
        }
        schema
    }
}

/// Bounds are checked in single precision.
impl Value for f32 {
    const FLAG: FlagKind = FlagKind::Number;

    fn kind(key: &Key) -> String {
        f64::kind(key)
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let value = field.as_number().map(narrow);
        let in_range = value.filter(|v| key.holds(f64::from(*v)));
        in_range.ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        format!("{self:?}")
    }

    fn schema(key: &Key) -> Json {
        f64::schema(&key.single())
    }
}

fn number_schema(kind: &str, key: &Key) -> Json {
    let mut range = json!({});
    for (bound, names) in
        [(key.low, ["minimum", "exclusiveMinimum"]), (key.high, ["maximum", "exclusiveMaximum"])]
    {
        if let Some(bound) = bound {
            range[names[usize::from(bound.is_excluded)]] = json_number(bound.value);
        }
    }
    if key.or_zero {
        return json!({ "type": kind, "anyOf": [{ "const": 0 }, range] });
    }
    range["type"] = json!(kind);
    range
}

/// Integers are written without a decimal point.
#[expect(clippy::cast_possible_truncation, reason = "checked to be whole and small")]
fn json_number(value: f64) -> Json {
    if value.fract() == 0.0 && value.abs() < 1e15 { json!(value as i64) } else { json!(value) }
}

/// Seconds, with a resolution of one nanosecond.
impl Value for Duration {
    const FLAG: FlagKind = FlagKind::Seconds;

    fn kind(key: &Key) -> String {
        f64::kind(&key.unit("seconds"))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let seconds = field.as_number().filter(|v| key.holds(*v));
        let time = seconds.and_then(|s| Self::try_from_secs_f64(s).ok());
        // Less than a nanosecond counts as zero.
        let time = time.filter(|time| key.holds(time.as_secs_f64()));
        time.ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        self.as_secs_f64().toml()
    }

    fn schema(key: &Key) -> Json {
        f64::schema(key)
    }
}

/// World coordinates.
impl Value for DVec3 {
    const FLAG: FlagKind = FlagKind::Numbers;

    fn kind(key: &Key) -> String {
        let kind = if key.is_direction {
            "three numbers that are not all 0, such as [0.0, 0.0, 1.0]"
        } else {
            "three numbers, such as [0.0, 1.0, 2.0]"
        };
        kind.to_owned()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let value = field
            .as_numbers()
            .map(Self::from_array)
            .filter(|v| !key.is_direction || *v != Self::ZERO);
        value.ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        list(self.to_array().iter().map(Value::toml))
    }

    fn schema(key: &Key) -> Json {
        let mut schema = numbers_schema(3);
        if key.is_direction {
            schema["contains"] = json!({ "not": { "const": 0 } });
        }
        schema
    }
}

pub(crate) fn numbers_schema(count: usize) -> Json {
    json!({ "type": "array", "items": { "type": "number" }, "minItems": count, "maxItems": count })
}
