//! Kinds of values: how each is read, written and described. What restricts them is in the [`Key`].

use std::time::Duration;

use glam::{DVec3, Vec3};
use serde_json::{Value as Json, json};
use spherule_formats::is_control;
use spherule_jobs::FrameRange;

use super::key::Key;
use super::reader::{Field, narrow};
use crate::metrics::Bytes;

/// Why a value is not accepted.
pub(super) enum Fault {
    /// It is not of the kind that [`Value::kind`] describes.
    Unwanted,
    /// As the text says.
    Because(String),
    /// The problems are already noted.
    Noted,
}

/// How an option of the command line takes a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlagKind {
    /// It takes none.
    Switch,
    /// A whole number.
    Integer,
    /// A number.
    Number,
    /// Text; it may begin with a hyphen if `true`.
    Text(bool),
    /// A number or a word.
    NumberOrText,
    /// Text, with commas between items.
    List,
}

/// A kind of value.
pub(super) trait Value: Sized {
    /// How an option takes it.
    const FLAG: FlagKind = FlagKind::Text(false);

    /// What it is, with its range, as in "wants a number from 0 to 1".
    fn kind(key: &Key) -> String;

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault>;

    /// As TOML.
    fn toml(&self) -> String;

    /// As JSON schema.
    fn schema(key: &Key) -> Json;

    /// What stands for it among the settings that images depend on.
    fn setting(&self) -> String {
        self.toml()
    }

    /// All words that are values.
    fn words() -> Vec<&'static str> {
        Vec::new()
    }
}

/// What a key sets: a value, or perhaps one.
pub(super) trait Slot {
    type Value: Value;

    fn get(&self) -> Option<&Self::Value>;

    fn set(&mut self, value: Option<Self::Value>);
}

impl<T: Value> Slot for T {
    type Value = T;

    fn get(&self) -> Option<&T> {
        Some(self)
    }

    fn set(&mut self, value: Option<T>) {
        if let Some(value) = value {
            *self = value;
        }
    }
}

impl<T: Value> Slot for Option<T> {
    type Value = T;

    fn get(&self) -> Option<&T> {
        self.as_ref()
    }

    fn set(&mut self, value: Self) {
        *self = value;
    }
}

/// A value that is one of some words.
pub(super) trait Named: Copy + PartialEq + 'static {
    /// All, with the names that users type.
    fn names() -> Vec<(Self, &'static str)>;
}

/// Declares an enum whose variants have the names that users type; or names those of an enum that is elsewhere.
macro_rules! named {
    ($(#[$meta:meta])* $name:ident { $($(#[$variant_meta:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $name {
            /// All, with the names that users type.
            pub const ALL: &[(Self, &'static str)] = &[$((Self::$variant, $text),)+];

            /// As users type it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        $crate::manifest::value::named!($name: $($variant = $text),+);
    };
    ($name:ident: $($variant:ident = $text:literal),+) => {
        impl $crate::manifest::value::Named for $name {
            fn names() -> Vec<(Self, &'static str)> {
                vec![$((Self::$variant, $text)),+]
            }
        }
    };
}
pub(super) use named;

impl<T: Named> Value for T {
    fn kind(_: &Key) -> String {
        format!("one of {}", Self::words().join(", "))
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let names = Self::names().into_iter();
        let mut found = names.filter(|(_, name)| field.as_text() == Some(name));
        found.next().map(|(value, _)| value).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        let found = Self::names().into_iter().find(|(value, _)| value == self);
        quoted(found.map_or("", |(_, name)| name))
    }

    fn schema(_: &Key) -> Json {
        json!({ "enum": Self::words() })
    }

    fn words() -> Vec<&'static str> {
        Self::names().into_iter().map(|(_, name)| name).collect()
    }
}

/// Each at most once, and at least one.
impl<T: Named> Value for Vec<T> {
    const FLAG: FlagKind = FlagKind::List;

    fn kind(key: &Key) -> String {
        format!("a list of {}, as {}", key.name, key.example)
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let items = field.items().filter(|items| !items.is_empty());
        let mut values = Self::new();
        for item in items.ok_or(Fault::Unwanted)? {
            let value = item.value::<T>(key).ok_or(Fault::Noted)?;
            if values.contains(&value) {
                item.fail(&format!(
                    "{} is there twice",
                    value.toml().trim_matches('"')
                ));
                return Err(Fault::Noted);
            }
            values.push(value);
        }
        Ok(values)
    }

    fn toml(&self) -> String {
        list(self.iter().map(Value::toml))
    }

    fn schema(key: &Key) -> Json {
        json!({ "type": "array", "items": T::schema(key), "minItems": 1, "uniqueItems": true })
    }
}

impl Value for bool {
    const FLAG: FlagKind = FlagKind::Switch;

    fn kind(_: &Key) -> String {
        "true or false".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        field.as_bool().ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        self.to_string()
    }

    fn schema(_: &Key) -> Json {
        json!({ "type": "boolean" })
    }
}

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

/// Bounds hold in single precision.
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
    for (bound, names) in [
        (key.low, ["minimum", "exclusiveMinimum"]),
        (key.high, ["maximum", "exclusiveMaximum"]),
    ] {
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

/// Whole numbers without a point.
#[expect(
    clippy::cast_possible_truncation,
    reason = "checked to be whole and small"
)]
fn json_number(value: f64) -> Json {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        json!(value as i64)
    } else {
        json!(value)
    }
}

/// Seconds, to the nanosecond.
impl Value for Duration {
    const FLAG: FlagKind = FlagKind::Number;

    fn kind(key: &Key) -> String {
        f64::kind(&key.unit("seconds"))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let seconds = field.as_number().filter(|v| key.holds(*v));
        let time = seconds.and_then(|s| Self::try_from_secs_f64(s).ok());
        // Less than a nanosecond is none.
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
    fn kind(key: &Key) -> String {
        let kind = match key.is_direction {
            true => "three numbers that are not all 0, as [0.0, 0.0, 1.0]",
            false => "three numbers, as [0.0, 1.0, 2.0]",
        };
        kind.to_owned()
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let value = field.as_numbers().map(Self::from_array);
        let value = value.filter(|v| !key.is_direction || *v != Self::ZERO);
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

/// Linear RGB; the range of the key is that of each component.
impl Value for Vec3 {
    fn kind(key: &Key) -> String {
        let example = match key.high {
            Some(_) => "[0.6, 0.9, 0.95]",
            None => "[0.6, 0.7, 0.9]",
        };
        format!("three numbers{}, as {example}", key.from(0).range())
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let color = field.as_numbers().map(|c: [f64; 3]| c.map(narrow));
        let key = key.from(0);
        let holds = |c: &[f32; 3]| c.iter().all(|c| key.holds(f64::from(*c)));
        color
            .filter(holds)
            .map(Self::from_array)
            .ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        list(self.to_array().iter().map(Value::toml))
    }

    fn schema(key: &Key) -> Json {
        let mut schema = numbers_schema(3);
        schema["items"] = f32::schema(&key.from(0));
        schema
    }
}

pub(super) fn numbers_schema(count: usize) -> Json {
    json!({ "type": "array", "items": { "type": "number" }, "minItems": count, "maxItems": count })
}

/// A name: text that is not blank.
const NAME_PATTERN: &str = r"\S";

impl Value for String {
    fn kind(_: &Key) -> String {
        "a name in quotes".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().filter(|t| !t.trim().is_empty());
        text.map(str::to_owned).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        quoted(self)
    }

    fn schema(_: &Key) -> Json {
        json!({ "type": "string", "pattern": NAME_PATTERN })
    }
}

/// Names, at least one.
impl Value for Vec<String> {
    const FLAG: FlagKind = FlagKind::List;

    fn kind(key: &Key) -> String {
        format!("a list of names, as {}", key.example)
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let items = field.items().filter(|items| !items.is_empty());
        let items = items.ok_or(Fault::Unwanted)?;
        let names = items.iter().map(|item| item.value(key));
        names.collect::<Option<_>>().ok_or(Fault::Noted)
    }

    fn toml(&self) -> String {
        list(self.iter().map(Value::toml))
    }

    fn schema(key: &Key) -> Json {
        json!({ "type": "array", "items": String::schema(key), "minItems": 1 })
    }
}

impl Value for FrameRange {
    const FLAG: FlagKind = FlagKind::Text(true);

    fn kind(_: &Key) -> String {
        "a frame range, as \"1-10\"".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = match (field.as_text(), field.as_integer()) {
            (Some(text), _) => text.to_owned(),
            (None, Some(frame)) => frame.to_string(),
            (None, None) => return Err(Fault::Unwanted),
        };
        text.parse().map_err(|e| Fault::Because(format!("{e}")))
    }

    fn toml(&self) -> String {
        quoted(&self.to_string())
    }

    /// Which numbers fit and which steps arrive is beyond it.
    fn schema(_: &Key) -> Json {
        let number = r"\s*-?[0-9]+\s*";
        let part = format!("{number}(-{number}([xy:]{number})?)?");
        let pattern = format!("^{part}(,{part})*$");
        json!({ "anyOf": [{ "type": "integer" }, { "type": "string", "pattern": pattern }] })
    }
}

/// Text or a number of bytes, above 0.
impl Value for Bytes {
    const FLAG: FlagKind = FlagKind::Text(true);

    fn kind(_: &Key) -> String {
        "a size above 0, as \"4GiB\", \"512MiB\" or a number of bytes".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let size = match (field.as_text(), field.as_integer()) {
            (Some(text), _) => text.parse().ok(),
            (None, Some(bytes)) => u64::try_from(bytes).ok().map(Bytes),
            (None, None) => None,
        };
        // TOML has no larger integers.
        let size = size.filter(|size| (1..=i64::MAX as u64).contains(&size.0));
        size.ok_or(Fault::Unwanted)
    }

    /// Exactly, in the largest unit that it is whole in.
    fn toml(&self) -> String {
        let units = [("GiB", 30), ("MiB", 20), ("KiB", 10)];
        let mut whole = units
            .iter()
            .filter(|(_, shift)| self.0.trailing_zeros() >= *shift);
        match whole.next() {
            Some((name, shift)) => quoted(&format!("{}{name}", self.0 >> shift)),
            None => self.0.to_string(),
        }
    }

    fn schema(_: &Key) -> Json {
        json!({ "anyOf": [
            { "type": "integer", "minimum": 1 },
            { "type": "string", "pattern": SIZE_PATTERN },
        ] })
    }
}

/// Sizes as a regular expression; parts of a unit need one larger than a byte.
const SIZE_PATTERN: &str = concat!(
    r"^\s*([0-9]+\s*([bB]|[kKmMgGtT]([iI]?[bB])?)?",
    r"|([0-9]+\.[0-9]*|\.[0-9]+)\s*[kKmMgGtT]([iI]?[bB])?)\s*$"
);

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

/// `text` as a TOML string on one line. What controls a terminal is escaped in it: manifests are printed.
pub(super) fn quoted(text: &str) -> String {
    if !text.contains(is_control) {
        return toml::Value::from(text).to_string();
    }
    let escaped = text.chars().map(|c| match c {
        '"' | '\\' => format!("\\{c}"),
        c if is_control(c) => format!("\\U{:08X}", u32::from(c)),
        c => c.to_string(),
    });
    format!("\"{}\"", escaped.collect::<String>())
}
