//! The defaults of a job that goes on: those of its plan, whatever the rules are now.

use std::collections::BTreeMap;

use toml::{Table, Value};

use super::legend::{COLORS, TIME};
use super::style::{self, STYLE, value};
use super::{COLOR, KEYS};
use crate::manifest::{ManifestSource, Override};

/// The types of overlays that rules add.
const OVERLAYS: [&str; 2] = [COLORS, TIME];

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
    let style = style::planned(planned).filter(|_| source.lacks(STYLE));
    layers.extend(style.and_then(|style| style::layer(style, "the plan of the job")));
    // Sizes of overlays that are given, and overlays after these
    let manifest = source.parse().ok().map(|(manifest, _)| manifest);
    let given = manifest.as_ref().map_or(0, |manifest| manifest.overlays.len());
    let sizes = (0..given).filter_map(|index| {
        let key = format!("overlay.{index}.size");
        let (_, text) = planned.iter().find(|(known, _)| *known == key)?;
        layer(&key, value(text)?)
    });
    layers.extend(sizes);
    if manifest.is_some_and(|m| m.legend) && (source.lacks("overlay") || given > 0) {
        layers.extend(overlays(planned, given));
    }
    layers
}

fn layer(key: &str, value: impl Into<Value>) -> Option<Override> {
    Override::new(key, value, "the plan of the job").ok()
}

/// The overlays of a plan after the `given` ones; none if there is one among these that no rule adds.
fn overlays(planned: &[(String, String)], given: usize) -> Vec<Override> {
    // Collect the keys of each overlay
    let mut items: BTreeMap<usize, Table> = BTreeMap::new();
    for (key, text) in planned {
        let place = key.strip_prefix("overlay.").and_then(|key| key.split_once('.'));
        if let Some((index, name)) = place
            && let Ok(index) = index.parse()
            && index >= given
            && let Some(value) = value(text)
        {
            items.entry(index).or_default().insert(name.to_owned(), value);
        }
    }
    // Take them only if rules made all of them
    let is_ours = |item: &Table| {
        let kind = item.get("type").and_then(Value::as_str);
        kind.is_some_and(|kind| OVERLAYS.contains(&kind))
    };
    if !items.values().all(is_ours) {
        return Vec::new();
    }
    let items = items.into_values();
    items.filter_map(|item| Override::append("overlay", item, "the plan of the job").ok()).collect()
}
