//! Settings from Python: JSON of a dict, whose keys are those of a manifest.

use pyo3::prelude::*;
use serde_json::Value;
use spherule::manifest::Override;

use crate::errors::{Class, Failure};

/// The settings in `json` as values that replace those of a manifest. Keys may have dots.
pub(crate) fn overrides(json: &str) -> Result<Vec<Override>, Failure> {
    let refused = |what: String| Failure::new(Class::Setting, format!("settings: {what}"));
    let Value::Object(sections) =
        serde_json::from_str(json).map_err(|error| refused(error.to_string()))?
    else {
        return Err(refused("expected a dict".to_owned()));
    };
    let mut all = Vec::new();
    for (section, value) in sections {
        match value {
            // One for each key, so that a section may be divided among dicts
            Value::Object(keys) if !section.contains('.') && !keys.is_empty() => {
                for (key, value) in keys {
                    all.push((format!("{section}.{key}"), value));
                }
            }
            value => all.push((section, value)),
        }
    }
    let convert = |(key, value): (String, Value)| {
        let converted = toml::Value::try_from(value);
        let value =
            converted.map_err(|_| refused(format!("{key}: None is no value; leave it out")))?;
        Override::new(&key, value, "settings").map_err(|error| refused(error.to_string()))
    };
    all.into_iter().map(convert).collect()
}

/// Raises a failure.
pub(crate) fn raised<T>(py: Python<'_>, result: Result<T, impl Into<Failure>>) -> PyResult<T> {
    result.map_err(|error| error.into().raise(py))
}
