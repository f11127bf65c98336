//! A manifest as one flat list of keys with values and comments, from which both the commented
//! file of `init` and the list of settings for fingerprints are made.

use std::fmt::Write as _;

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
        toml::Value::from(self).to_string()
    }
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

struct Entry {
    header: String,
    key: String,
    /// As TOML; None if it is not set.
    value: Option<String>,
    /// What it might be set to.
    example: &'static str,
    comment: &'static str,
    /// What stands for the value among the settings; None if outputs do not depend on it.
    setting: Option<String>,
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
    pub(super) fn put(&mut self, key: &str, value: &(impl Toml + ?Sized), comment: &'static str) {
        let value = value.toml();
        self.push(key, Some(value), "", comment);
    }

    /// A key with its value if it is set; else the `example` is shown as a comment.
    pub(super) fn maybe(
        &mut self,
        key: &str,
        value: Option<&(impl Toml + ?Sized)>,
        example: &'static str,
        comment: &'static str,
    ) {
        self.push(key, value.map(Toml::toml), example, comment);
    }

    /// Says that outputs depend on `setting` only, of the key last put, or not on it at all.
    pub(super) fn depends_on(&mut self, setting: Option<String>) {
        if let Some(last) = self.list.last_mut() {
            last.setting = setting;
        }
    }

    fn push(
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
        });
    }

    pub(super) fn keys(&self) -> Vec<String> {
        self.list.iter().map(|e| e.key.clone()).collect()
    }

    /// Every key with its value, or with an example where it is not set.
    #[cfg(test)]
    pub(super) fn samples(&self) -> Vec<(String, String)> {
        let value = |e: &Entry| e.value.clone().unwrap_or_else(|| e.example.to_owned());
        self.list
            .iter()
            .map(|e| (e.key.clone(), value(e)))
            .collect()
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
            let name = entry.key.rsplit('.').next().unwrap_or_default();
            let line = match &entry.value {
                Some(value) => format!("{name} = {value}"),
                None => format!("# {name} = {}", entry.example),
            };
            let _ = writeln!(text, "{line:<COMMENT_COLUMN$} # {}", entry.comment);
        }
        text
    }
}
