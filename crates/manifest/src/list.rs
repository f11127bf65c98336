//! A manifest as one flat list of keys with values. From it the commented file of `init`, the settings that images
//! depend on, the JSON schema, the manual and the options of the command line are made.

use std::fmt::Write as _;

use serde_json::Value as Json;

use super::key::{Affects, Key, paragraphs};
use super::value::{FlagKind, Value};

/// Column in which comments begin, unless the value is too long.
const COMMENT_COLUMN: usize = 40;

/// One key and its value.
pub(super) struct Entry {
    /// The dotted key, such as `light.0.color`.
    pub(super) key: String,
    /// The table that contains it, such as `light.0`.
    pub(super) section: String,
    /// The heading of the table.
    header: String,
    pub(super) about: String,
    pub(super) declared: Key,
    /// The value as TOML; None if it is not set.
    pub(super) value: Option<String>,
    /// The value in the settings that images depend on.
    setting: Option<String>,
    /// Description of the valid values, with their range.
    #[cfg(test)]
    pub(super) kind: String,
    pub(super) schema: Json,
    pub(super) flag_kind: FlagKind,
    /// All words that are values.
    pub(super) words: Vec<&'static str>,
}

impl Entry {
    pub(super) const fn name(&self) -> &'static str {
        self.declared.name
    }

    /// The value as TOML, or an example if it is not set.
    pub(super) fn sample(&self) -> &str {
        self.value.as_deref().unwrap_or(self.declared.example)
    }

    /// An example as TOML, or the value if there is none.
    fn example(&self) -> &str {
        match self.declared.example {
            "" => self.sample(),
            example => example,
        }
    }

    fn line(&self, hash: &str, value: &str) -> String {
        let line = format!("{hash}{} = {value}", self.name());
        format!("{line:<COMMENT_COLUMN$} # {}\n", self.comment())
    }

    /// The comment in the file: the meaning, and the effect if the key is not set.
    pub(super) fn comment(&self) -> String {
        let comment = self.declared.comment();
        match self.declared.unset {
            Some(unset) => format!("{comment}; default: {unset}"),
            None => comment,
        }
    }
}

/// All keys in the order of the file.
#[derive(Default)]
pub(super) struct Entries {
    list: Vec<Entry>,
    header: String,
    section: String,
    about: String,
}

impl Entries {
    /// Continues with the keys of `[section]`.
    pub(super) fn section(&mut self, section: &str, about: &[&'static str]) {
        self.header = format!("[{section}]");
        section.clone_into(&mut self.section);
        self.about = paragraphs(about).swap_remove(0);
    }

    /// Continues with the keys of the item `index` of `[[list]]`.
    pub(super) fn item(&mut self, list: &str, index: usize, about: &[&'static str]) {
        self.section(list, about);
        self.header = format!("[[{list}]]");
        self.section = format!("{list}.{index}");
    }

    pub(super) fn push<T: Value>(&mut self, key: Key, value: Option<&T>) {
        let word = || key.word.map(|word| word.to_owned().toml());
        self.list.push(Entry {
            key: match &*self.section {
                "" => key.name.to_owned(),
                section => format!("{section}.{}", key.name),
            },
            section: self.section.clone(),
            header: self.header.clone(),
            about: self.about.clone(),
            declared: key,
            value: value.map(Value::toml).or_else(word),
            setting: value.map(Value::setting).or_else(word),
            #[cfg(test)]
            kind: T::kind(&key),
            schema: with_words(T::schema(&key), &key),
            flag_kind: match (key.word, T::FLAG) {
                (Some(_), FlagKind::Integer | FlagKind::Number | FlagKind::Seconds) => {
                    FlagKind::NumberOrText
                }
                (Some(_), FlagKind::Switch) => FlagKind::SwitchOrText("true"),
                (_, FlagKind::Text(false)) => {
                    FlagKind::Text(T::words().iter().any(|word| word.starts_with('-')))
                }
                (_, kind) => kind,
            },
            words: T::words().into_iter().chain(key.word).collect(),
        });
    }

    pub(super) fn list(&self) -> &[Entry] {
        &self.list
    }

    /// The keys that are set and that images depend on; `holds` evaluates the conditions.
    pub(super) fn settings(&self, holds: impl Fn(Affects) -> bool) -> Vec<(String, String)> {
        let set = |e: &Entry| Some((e.key.clone(), e.setting.clone()?));
        let affect = self.list.iter().filter(|e| holds(e.declared.affects));
        affect.filter_map(set).collect()
    }

    /// The commented file; keys that are not set are commented out.
    pub(super) fn file(&self) -> String {
        self.file_of(|_| true)
    }

    /// The commented file with only the keys that `is_part`.
    pub(super) fn file_of(&self, is_part: impl Fn(&Entry) -> bool) -> String {
        let mut text = String::new();
        let mut section = "";
        for entry in self.list.iter().filter(|entry| is_part(entry)) {
            if entry.section != section {
                section = &entry.section;
                let _ = writeln!(text, "\n{}", entry.header);
            }
            let hash = if entry.value.is_some() { "" } else { "# " };
            text += &entry.line(hash, entry.sample());
        }
        text
    }

    /// The first item of a list as an example, commented out.
    pub(super) fn commented_out(&self, list: &str) -> String {
        let section = format!("{list}.0");
        let own = self.list.iter().filter(|entry| entry.section == section);
        let lines = own.map(|entry| entry.line("# ", entry.example()));
        format!("# [[{list}]]\n{}", lines.collect::<String>())
    }
}

/// `schema`, extended by the word of `key` and by old names.
fn with_words(mut schema: Json, key: &Key) -> Json {
    if let (Some([old, _]), Some(Json::Array(words))) = (key.renamed, schema.get_mut("enum")) {
        words.push(old.into());
    }
    let Some(word) = key.word else {
        return schema;
    };
    if let Some(words) = schema.get_mut("enum").and_then(Json::as_array_mut) {
        words.insert(0, word.into());
        return schema;
    }
    let constant = serde_json::json!({ "const": word });
    if let Some(kinds) = schema.get_mut("anyOf").and_then(Json::as_array_mut) {
        kinds.insert(0, constant);
        return schema;
    }
    serde_json::json!({ "anyOf": [constant, schema] })
}
