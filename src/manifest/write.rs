//! A manifest as one flat list of keys with values and comments, from which the commented file of
//! `init`, the list of settings for fingerprints and the JSON schema are made.

use std::fmt::Write as _;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use spherule_formats::is_control;

/// Comments begin here where the value leaves room.
const COMMENT_COLUMN: usize = 40;

/// How a value is written in TOML.
pub(super) trait Toml {
    fn toml(&self) -> String;
}

impl Toml for f64 {
    fn toml(&self) -> String {
        format!("{self:?}")
    }
}

impl Toml for f32 {
    fn toml(&self) -> String {
        format!("{self:?}")
    }
}

impl Toml for u32 {
    fn toml(&self) -> String {
        self.to_string()
    }
}

impl Toml for i64 {
    fn toml(&self) -> String {
        self.to_string()
    }
}

impl Toml for bool {
    fn toml(&self) -> String {
        self.to_string()
    }
}

impl Toml for str {
    fn toml(&self) -> String {
        if self.contains(is_control) {
            return basic_string(self);
        }
        toml::Value::from(self).to_string()
    }
}

/// `text` as a string on one line. What controls a terminal is an escape in it: manifests are printed.
fn basic_string(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        // Writing to a string cannot fail.
        let _ = match c {
            '"' | '\\' => write!(quoted, "\\{c}"),
            c if is_control(c) => write!(quoted, "\\U{:08X}", u32::from(c)),
            c => write!(quoted, "{c}"),
        };
    }
    quoted + "\""
}

impl Toml for String {
    fn toml(&self) -> String {
        self.as_str().toml()
    }
}

impl<T: Toml + ?Sized> Toml for &T {
    fn toml(&self) -> String {
        (*self).toml()
    }
}

impl<T: Toml> Toml for [T] {
    fn toml(&self) -> String {
        let items: Vec<String> = self.iter().map(Toml::toml).collect();
        format!("[{}]", items.join(", "))
    }
}

impl<T: Toml, const N: usize> Toml for [T; N] {
    fn toml(&self) -> String {
        self.as_slice().toml()
    }
}

impl<T: Toml> Toml for Vec<T> {
    fn toml(&self) -> String {
        self.as_slice().toml()
    }
}

/// Says in JSON schema what a value of a type looks like in a manifest.
macro_rules! described {
    ($type:ty, $schema:tt) => {
        impl schemars::JsonSchema for $type {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($type).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!($schema)
            }
        }
    };
}
pub(super) use described;

/// One key.
pub(super) struct Entry {
    header: String,
    /// Dotted.
    pub(super) key: String,
    /// As TOML; None if it is not set.
    pub(super) value: Option<String>,
    /// What it might be set to.
    pub(super) example: &'static str,
    pub(super) comment: &'static str,
    /// What its values look like.
    pub(super) schema: fn(&mut SchemaGenerator) -> Schema,
    /// What stands for the value among the settings; None if outputs do not depend on it.
    setting: Option<String>,
}

impl Entry {
    /// The last part of the key.
    pub(super) fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or_default()
    }

    /// The rest of it.
    pub(super) fn section(&self) -> &str {
        self.key.rsplit_once('.').map_or("", |(section, _)| section)
    }

    /// The value, or an example where it is not set, as TOML.
    pub(super) fn sample(&self) -> &str {
        self.value.as_deref().unwrap_or(self.example)
    }
}

/// All keys in the order in which they are written.
#[derive(Default)]
pub(super) struct Entries {
    list: Vec<Entry>,
    header: String,
    prefix: String,
}

impl Entries {
    /// Goes on under `[section]`.
    pub(super) fn section(&mut self, section: &str) {
        self.header = format!("[{section}]");
        self.prefix = section.to_owned();
    }

    /// Goes on under the item `index` of `[[section]]`.
    pub(super) fn item(&mut self, section: &str, index: usize) {
        self.header = format!("[[{section}]] # {index}");
        self.prefix = format!("{section}.{index}");
    }

    /// A key with its value.
    pub(super) fn put<T: Toml + JsonSchema + ?Sized>(
        &mut self,
        key: &str,
        value: &T,
        comment: &'static str,
    ) {
        self.push::<T>(key, Some(value.toml()), "", comment);
    }

    /// A key with its value if it is set; else the `example` is shown as a comment.
    pub(super) fn maybe<T: Toml + JsonSchema + ?Sized>(
        &mut self,
        key: &str,
        value: Option<&T>,
        example: &'static str,
        comment: &'static str,
    ) {
        self.push::<T>(key, value.map(Toml::toml), example, comment);
    }

    /// Says that outputs depend on `setting` only, of the key last put, or not on it at all.
    pub(super) fn depends_on(&mut self, setting: Option<String>) {
        if let Some(last) = self.list.last_mut() {
            last.setting = setting;
        }
    }

    fn push<T: JsonSchema + ?Sized>(
        &mut self,
        key: &str,
        value: Option<String>,
        example: &'static str,
        comment: &'static str,
    ) {
        self.list.push(Entry {
            header: self.header.clone(),
            key: format!("{}.{key}", self.prefix),
            setting: value.clone(),
            value,
            example,
            comment,
            schema: SchemaGenerator::subschema_for::<T>,
        });
    }

    /// All of them.
    pub(super) fn list(&self) -> &[Entry] {
        &self.list
    }

    pub(super) fn keys(&self) -> Vec<String> {
        self.list.iter().map(|e| e.key.clone()).collect()
    }

    /// The keys that outputs depend on and that are set.
    pub(super) fn settings(&self) -> Vec<(String, String)> {
        let set = |e: &Entry| Some((e.key.clone(), e.setting.clone()?));
        self.list.iter().filter_map(set).collect()
    }

    /// The commented file.
    pub(super) fn file(&self) -> String {
        let mut text = String::new();
        let mut header = "";
        for entry in &self.list {
            if entry.header != header {
                header = &entry.header;
                let shown = header.split(" #").next().unwrap_or_default();
                let _ = writeln!(text, "\n{shown}");
            }
            let name = entry.name();
            let line = match &entry.value {
                Some(value) => format!("{name} = {value}"),
                None => format!("# {name} = {}", entry.example),
            };
            let _ = writeln!(text, "{line:<COMMENT_COLUMN$} # {}", entry.comment);
        }
        text
    }
}
