//! Names, frame ranges and sizes.

use serde_json::{Value as Json, json};
use spherule_files::Bytes;
use spherule_jobs::FrameRange;

use super::{Fault, FlagKind, Value, list, quoted};
use crate::field::Field;
use crate::key::Key;

/// A name is text that is not blank.
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

/// At least one name.
impl Value for Vec<String> {
    const FLAG: FlagKind = FlagKind::List;

    fn kind(key: &Key) -> String {
        format!("a list of names, such as {}", key.example)
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let items = field.items().filter(|items| !items.is_empty()).ok_or(Fault::Unwanted)?;
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
        "a frame range, such as \"1-10\"".to_owned()
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
        "a size above 0, such as \"4GiB\", \"512MiB\" or a number of bytes".to_owned()
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
        let mut whole = units.iter().filter(|(_, shift)| self.0.trailing_zeros() >= *shift);
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

/// Sizes as a regular expression; fractions require a unit larger than a byte.
const SIZE_PATTERN: &str = concat!(
    r"^\s*([0-9]+\s*([bB]|[kKmMgGtT]([iI]?[bB])?)?",
    r"|([0-9]+\.[0-9]*|\.[0-9]+)\s*[kKmMgGtT]([iI]?[bB])?)\s*$"
);
