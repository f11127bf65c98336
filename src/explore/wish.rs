//! What a page asks for.

use serde::{Deserialize, Serialize};

use super::error::Fault;
use crate::manifest::Override;

/// A setting that was chosen.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Setting {
    /// The dotted key of the manifest.
    pub key: String,
    /// Its value.
    pub value: serde_json::Value,
}

/// What a page shows.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wish {
    /// Number of the frame.
    pub frame: i64,
    /// The settings that were chosen, over those of the command.
    pub settings: Vec<Setting>,
    /// Whether more wishes follow at once, as while the mouse moves: then one quick picture is enough.
    #[serde(default)]
    pub is_moving: bool,
}

/// The settings as values that replace those of a manifest.
///
/// # Errors
/// A key is empty, or a value cannot be written in TOML, as `null`.
pub(super) fn overrides(settings: &[Setting]) -> Result<Vec<Override>, Fault> {
    let of = |setting: &Setting| {
        let Setting { key, value } = setting;
        let fault = |what: String| Fault { message: what, key: Some(key.clone()) };
        // TOML has no null, and JSON has it for numbers that are not finite
        let value = toml::Value::try_from(value)
            .map_err(|_| fault(format!("{key}: a value of a manifest is needed, not {value}")))?;
        // The option that would set the same value
        let shown = format!("--set {key}={value}");
        Override::new(key, value, &shown).map_err(|error| fault(error.to_string()))
    };
    settings.iter().map(of).collect()
}
