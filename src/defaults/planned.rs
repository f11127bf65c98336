//! The defaults of a job that goes on: those of its plan, whatever the rules are now.

use std::collections::BTreeMap;

use toml::{Table, Value};

use super::{COLOR, KEYS};
use crate::manifest::{ManifestSource, Override};

/// The kinds of overlays that rules add.
const OVERLAYS: [&str; 2] = ["colorbar", "text"];

/// What the `planned` settings of a job (dotted keys, values in TOML) have for keys that rules set and that `source` does
/// not give.
pub fn planned(source: &ManifestSource, planned: &[(String, String)]) -> Vec<Override> {
    let is_missing = |key: &str| match key {
        COLOR => source.lacks("material.color.attribute"),
        key => source.lacks(key),
    };
    let ours = planned.iter().filter(|(key, _)| KEYS.contains(&&**key) && is_missing(key));
    let mut layers: Vec<Override> = ours
        .flat_map(|(key, text)| match (&**key, value(text)) {
            // A map may be given without the attribute
            (COLOR, Some(Value::Table(table))) => {
                let each = |(name, value)| layer(&format!("{COLOR}.{name}"), value);
                table.into_iter().filter_map(each).collect()
            }
            (key, Some(value)) => layer(key, value).into_iter().collect(),
            (_, None) => Vec::new(),
        })
        .collect();
    if source.lacks("overlay")
        && let Some(overlays) = overlays(planned)
    {
        layers.extend(layer("overlay", overlays));
    }
    // Sizes of overlays that are given
    let given = source.parse().map_or(0, |(manifest, _)| manifest.overlays.len());
    let sizes = (0..given).filter_map(|index| {
        let key = format!("overlay.{index}.size");
        let (_, text) = planned.iter().find(|(known, _)| *known == key)?;
        layer(&key, value(text)?)
    });
    layers.extend(sizes);
    layers
}

fn layer(key: &str, value: impl Into<Value>) -> Option<Override> {
    Override::new(key, value, "the plan of the job").ok()
}

/// A value that was written as TOML.
fn value(text: &str) -> Option<Value> {
    let mut table: Table = format!("value = {text}").parse().ok()?;
    table.remove("value")
}

/// The overlays of a plan; None without any, and if there is one that no rule adds.
fn overlays(planned: &[(String, String)]) -> Option<Value> {
    let mut items: BTreeMap<usize, Table> = BTreeMap::new();
    for (key, text) in planned {
        let Some((index, name)) = key.strip_prefix("overlay.").and_then(|k| k.split_once('.'))
        else {
            continue;
        };
        let item = items.entry(index.parse().ok()?).or_default();
        item.insert(name.to_owned(), value(text)?);
    }
    let is_ours = |item: &Table| {
        let kind = item.get("type").and_then(Value::as_str);
        kind.is_some_and(|kind| OVERLAYS.contains(&kind))
    };
    let all: Vec<Table> = items.into_values().collect();
    (!all.is_empty() && all.iter().all(is_ours)).then(|| all.into())
}
