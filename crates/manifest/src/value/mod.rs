//! Types of values: how each is read, written and described. Restrictions are in the [`Key`].

use serde_json::{Value as Json, json};
use spherule_files::is_control;

use super::field::Field;
use super::key::Key;
use super::nearest::nearest;

mod color;
mod color_names;
mod numbers;
mod text;

pub(super) use color::{COLOR_SCHEMA, color_schema};
pub(super) use numbers::numbers_schema;

/// Reasons why a value is not accepted.
pub(super) enum Fault {
    /// It does not match the description of [`Value::kind`].
    Unwanted,
    /// The reason in the text.
    Because(String),
    /// Problems that have been reported already.
    Noted,
}

/// The kind of value of a command-line option.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlagKind {
    /// No value.
    Switch,
    /// An integer.
    Integer,
    /// A number.
    Number,
    /// A number of seconds.
    Seconds,
    /// Text; it may begin with a hyphen if `true`.
    Text(bool),
    /// Text, or no value, which means this text.
    SwitchOrText(&'static str),
    /// A number or a word, or no value, which means this word.
    SwitchOrNumberOrText(&'static str),
    /// A number or a word.
    NumberOrText,
    /// A value in TOML, or text without quotes.
    Toml,
    /// Text, with commas between items.
    List,
    /// Integers with commas between them.
    Integers,
    /// Numbers with commas between them.
    Numbers,
}

/// A type of values.
pub(super) trait Value: Sized {
    /// The kind of value of an option for it.
    const FLAG: FlagKind = FlagKind::Text(false);

    /// Description with the range, as in "expected a number from 0 to 1".
    fn kind(key: &Key) -> String;

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault>;

    /// As TOML.
    fn toml(&self) -> String;

    /// As JSON schema.
    fn schema(key: &Key) -> Json;

    /// The value in the settings that images depend on.
    fn setting(&self) -> String {
        self.toml()
    }

    /// All words that are values.
    fn words() -> Vec<&'static str> {
        Vec::new()
    }
}

impl Field<'_> {
    /// The value; reports a problem and returns None if it is invalid.
    pub(super) fn value<T: Value>(&self, key: &Key) -> Option<T> {
        let what = match T::parse(self, key) {
            Ok(value) => return Some(value),
            Err(Fault::Noted) => return None,
            Err(Fault::Because(what)) => what,
            Err(Fault::Unwanted) => {
                let text = self.as_text().unwrap_or_default();
                let hint = nearest(text, &T::words()).map(|n| format!("; did you mean {n}?"));
                let (expected, hint) = (expected::<T>(key), hint.unwrap_or_default());
                format!("expected {expected}, found {}{hint}", self.node.describe())
            }
        };
        self.fail(&what);
        None
    }
}

/// Description of the expected value for messages.
fn expected<T: Value>(key: &Key) -> String {
    let kind = T::kind(key);
    match key.word {
        Some(word @ "all") => format!("\"{word}\" or {kind}"),
        Some(word) => format!("{kind} or \"{word}\""),
        None => kind,
    }
}

/// The target of a key: a value, or an optional value.
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

/// A value with a fixed set of names.
pub(super) trait Named: Copy + PartialEq + 'static {
    /// All values with their names.
    fn names() -> Vec<(Self, &'static str)>;
}

/// Declares an enum with names for its variants, or names the variants of an existing enum.
macro_rules! named {
    ($(#[$meta:meta])* $name:ident { $($(#[$variant_meta:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $name {
            /// The name in a manifest.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        $crate::value::named!($name: $($variant = $text),+);
    };
    ($name:ident: $($variant:ident = $text:literal),+) => {
        impl $crate::value::Named for $name {
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

    fn words() -> Vec<&'static str> {
        vec!["true", "false"]
    }
}

pub(super) fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

/// `text` as a TOML string on one line. Control characters of terminals are escaped, because manifests are printed.
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
