//! The JSON schema of the manifest, for completion and error marking in editors.
//!
//! All of it comes from the declarations of the keys and from the rules between them ([`Rule`]). Further checks (a
//! camera at its own target, for example) are only made by the reader.

use serde_json::{Map, Value, json};

use super::list::{Entries, Entry};
use super::rule::{Rule, conditions};
use super::value::{COLOR_SCHEMA, color_schema};
use super::{ABOUT, Manifest, camera, check, environment, mesh, style, work};

#[cfg(test)]
mod tests;

/// Name of the schema next to a manifest that refers to it.
pub const SCHEMA_FILE: &str = "job.schema.json";

/// The schema of manifests (draft 2020-12).
pub fn job_schema() -> Value {
    // Keys outside tables
    let entries = Manifest::examples().entries();
    let outside = entries.list().iter().filter(|entry| entry.section.is_empty());
    let mut properties: Map<_, _> =
        outside.map(|entry| (entry.name().to_owned(), property(entry))).collect();
    for section in sections(&entries).filter(|s| !s.is_empty() && !s.contains('.')) {
        properties.insert(section.to_owned(), table(&entries, section));
    }
    add_lists(&mut properties, &entries);
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "spherule job",
        "description": ABOUT,
        "type": "object",
        "properties": properties,
        "required": ["input"],
        "additionalProperties": false,
        "allOf": conditions(check::RULES),
        "$defs": { COLOR_SCHEMA: color_schema() },
    })
}

/// Adds every list of tables to the table that contains it.
fn add_lists(properties: &mut Map<String, Value>, entries: &Entries) {
    // Collect the tables of each list; an item may have several types
    let mut kinds: Vec<(&str, Vec<Value>)> = Vec::new();
    for section in sections(entries) {
        let Some((list, _)) = section.rsplit_once('.') else {
            continue;
        };
        let table = table(entries, section);
        match kinds.iter_mut().find(|(name, _)| *name == list) {
            Some((_, tables)) => tables.push(table),
            None => kinds.push((list, vec![table])),
        }
    }
    // Put each list into its table
    for (list, mut tables) in kinds {
        let description = tables[0]["description"].clone();
        let item = match tables.len() {
            1 => tables.remove(0),
            _ => json!({ "oneOf": tables }),
        };
        let schema = json!({ "description": description, "type": "array", "items": item });
        match list.split_once('.') {
            Some((section, name)) => properties[section]["properties"][name] = schema,
            None => {
                properties.insert(list.to_owned(), schema);
            }
        }
    }
}

/// The tables of `entries` in order, each once.
pub(super) fn sections(entries: &Entries) -> impl Iterator<Item = &str> {
    let tables = entries.list().chunk_by(|a, b| a.section == b.section);
    tables.map(|table| &*table[0].section)
}

fn table(entries: &Entries, section: &str) -> Value {
    let keys: Vec<&Entry> = entries.list().iter().filter(|e| e.section == section).collect();
    let required: Vec<&str> =
        keys.iter().filter(|e| e.declared.required.is_some()).map(|e| e.name()).collect();
    let properties = keys.iter().map(|e| (e.name().to_owned(), property(e)));
    let mut table = json!({
        "description": keys[0].about,
        "type": "object",
        "properties": properties.collect::<Map<_, _>>(),
        "additionalProperties": false,
    });
    if !required.is_empty() {
        table["required"] = json!(required);
    }
    let rules = rules_of(section);
    if !rules.is_empty() {
        table["allOf"] = conditions(rules);
    }
    table
}

/// The rules between the keys of a table.
fn rules_of(section: &str) -> &'static [Rule] {
    match section {
        "camera" => camera::RULES,
        "environment" => environment::RULES,
        "job" => work::RULES,
        "mesh.0" => mesh::RULES,
        "style.0" => style::RULES,
        _ => &[],
    }
}

fn property(entry: &Entry) -> Value {
    // The type of a light or an overlay determines its keys.
    let is_typed =
        ["clip.", "light.", "overlay."].iter().any(|list| entry.section.starts_with(list));
    let mut schema = match entry.name() {
        "type" if is_typed => {
            json!({ "const": json_of(entry.sample()) })
        }
        _ => entry.schema.clone(),
    };
    schema["description"] = json!(entry.comment());
    if entry.declared.required.is_none() {
        match entry.value {
            Some(_) => schema["default"] = json_of(entry.sample()),
            None => schema["examples"] = json!([json_of(entry.sample())]),
        }
    }
    schema
}

/// Converts a TOML value of this program to JSON.
fn json_of(value: &str) -> Value {
    let table: toml::Table =
        format!("value = {value}").parse().expect("what is written as TOML is TOML");
    serde_json::to_value(&table["value"]).expect("it has no numbers that JSON lacks")
}
