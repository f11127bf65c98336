//! Options of the command line for keys.

use super::Manifest;
use super::key::Flag;
use super::value::FlagKind;

/// An option of the command line that sets a key.
#[derive(Debug, Clone)]
pub struct KeyFlag {
    /// The dotted key.
    pub key: String,
    /// The option.
    pub flag: Flag,
    /// The kind of value.
    pub kind: FlagKind,
    /// All words that are values.
    pub words: Vec<&'static str>,
    /// One line of help.
    pub help: String,
    /// More paragraphs of help.
    pub details: Vec<String>,
    /// The default as it would be typed, or a description.
    pub default: Option<String>,
}

/// The options of all keys that have one, in the order of the manifest.
pub fn key_flags() -> Vec<KeyFlag> {
    let entries = Manifest::new("").entries();
    let flags = entries.list().iter().filter_map(|entry| {
        let typed = |value: &String| {
            let typed = value.replace(['"', '[', ']', ' '], "");
            typed.strip_suffix(".0").unwrap_or(&typed).to_owned()
        };
        let unset = entry.declared.unset.map(str::to_owned);
        Some(KeyFlag {
            key: entry.key.clone(),
            flag: entry.declared.flag?,
            kind: entry.flag_kind,
            words: entry.words.clone(),
            help: entry.declared.comment(),
            details: entry.declared.details(),
            default: unset.or_else(|| entry.value.as_ref().map(typed)),
        })
    });
    flags.collect()
}
