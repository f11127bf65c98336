//! The manifest's JSON schema, for editors: completion, and mistakes underlined while typing.
//!
//! Keys, defaults, examples and descriptions come from the list of entries that `init` writes, types from
//! the values in it; `limits` adds what types do not say. What the reader refuses beyond that (a camera
//! that looks at itself) is known to the reader alone.

use schemars::SchemaGenerator;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use super::write::{Entries, Entry};
use super::{ABOUT, Manifest};

mod limits;
#[cfg(test)]
mod tests;

/// Name of the schema beside a manifest that refers to it.
pub const SCHEMA_FILE: &str = "job.schema.json";

/// A name: text that is not blank.
const NAME_PATTERN: &str = r"\S";

/// Lists with an item of every kind, all keys with defaults left out.
const ITEMS: &str = r#"
input.path = "data"
camera.key = [{ frame = 0, eye = [0, 0, 1], look_at = [0, 0, 0] }]
light = [
    { type = "point", position = [0, 0, 10] },
    { type = "directional", direction = [0, 0, -1] },
]
"#;

/// The schema of manifests (draft 2020-12).
pub fn job_schema() -> Value {
    let mut generator = SchemaSettings::draft2020_12().into_generator();
    let plain = Manifest::new("").entries();
    let mut properties = Map::new();
    for section in sections(&plain) {
        let mut table = table(&plain, section, &mut generator);
        if let Some(conditions) = limits::conditions(section) {
            table["allOf"] = conditions;
        }
        properties.insert(section.to_owned(), table);
    }
    add_lists(&mut properties, &mut generator);
    json!({
        "$schema": generator.settings().meta_schema,
        "title": "spherule job",
        "description": ABOUT,
        "type": "object",
        "properties": properties,
        "required": ["input"],
        "additionalProperties": false,
    })
}

/// Puts every list of tables where it belongs.
fn add_lists(properties: &mut Map<String, Value>, generator: &mut SchemaGenerator) {
    let items = Manifest::parse(ITEMS, "ITEMS".as_ref()).expect("a good manifest");
    let items = items.entries();
    let mut kinds: Vec<(String, Vec<Value>)> = Vec::new();
    for section in sections(&items).filter(|s| s.contains('.')) {
        let list = without_numbers(section);
        let table = table(&items, section, generator);
        match kinds.iter_mut().find(|(name, _)| *name == list) {
            Some((_, tables)) => tables.push(table),
            None => kinds.push((list, vec![table])),
        }
    }
    for (list, mut tables) in kinds {
        let item = match tables.len() {
            1 => tables.remove(0),
            _ => json!({ "oneOf": tables }),
        };
        let schema = json!({
            "description": limits::about(&list),
            "type": "array",
            "items": item,
        });
        match list.split_once('.') {
            Some((section, name)) => properties[section]["properties"][name] = schema,
            None => {
                properties.insert(list, schema);
            }
        }
    }
}

/// The tables of `entries`, each once, in order.
fn sections(entries: &Entries) -> impl Iterator<Item = &str> {
    let all = entries.list();
    let is_first =
        |(at, entry): &(usize, &Entry)| *at == 0 || all[*at - 1].section() != entry.section();
    let firsts = all.iter().enumerate().filter(is_first);
    firsts.map(|(_, entry)| entry.section())
}

fn table(entries: &Entries, section: &str, generator: &mut SchemaGenerator) -> Value {
    let keys = || entries.list().iter().filter(|e| e.section() == section);
    let is_required = |e: &&Entry| limits::REQUIRED.contains(&&*without_numbers(&e.key));
    let properties: Map<String, Value> = keys()
        .map(|entry| (entry.name().to_owned(), property(entry, generator)))
        .collect();
    let required: Vec<&str> = keys().filter(is_required).map(Entry::name).collect();
    let mut table = json!({
        "description": limits::about(&without_numbers(section)),
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
    });
    if !required.is_empty() {
        table["required"] = json!(required);
    }
    table
}

fn property(entry: &Entry, generator: &mut SchemaGenerator) -> Value {
    let key = without_numbers(&entry.key);
    let sample = json_of(entry.sample());
    // The kind of an item decides which keys it has.
    let mut schema = if entry.name() == "type" {
        json!({ "const": sample })
    } else {
        Value::from((entry.schema)(generator))
    };
    drop_formats(&mut schema);
    merge(&mut schema, limits::limits(&key));
    schema["description"] = json!(entry.comment);
    if !limits::REQUIRED.contains(&&*key) {
        match entry.value {
            Some(_) => schema["default"] = sample,
            None => schema["examples"] = json!([sample]),
        }
    }
    schema
}

/// `light.0.type` as `light.type`.
fn without_numbers(key: &str) -> String {
    let is_name = |part: &&str| part.parse::<usize>().is_err();
    key.split('.').filter(is_name).collect::<Vec<_>>().join(".")
}

/// A value of our own as JSON.
fn json_of(value: &str) -> Value {
    let table: toml::Table = format!("value = {value}")
        .parse()
        .expect("what is written as TOML is TOML");
    serde_json::to_value(&table["value"]).expect("it has no numbers that JSON lacks")
}

/// Formats say how a number is stored here, which is of no use to who writes it.
fn drop_formats(schema: &mut Value) {
    if let Value::Object(map) = schema {
        map.remove("format");
        if let Some(items) = map.get_mut("items") {
            drop_formats(items);
        }
    }
}

/// Lays `over` over `schema`, table by table.
fn merge(schema: &mut Value, over: Value) {
    match (schema, over) {
        (Value::Object(schema), Value::Object(over)) => {
            for (key, value) in over {
                merge(schema.entry(key).or_insert(Value::Null), value);
            }
        }
        (schema, over) => *schema = over,
    }
}

/// `first`, then the words that users type.
pub(super) fn words<T>(first: &[&'static str], names: &[(T, &'static str)]) -> Vec<&'static str> {
    let names = names.iter().map(|(_, name)| *name);
    first.iter().copied().chain(names).collect()
}

/// Text that is not blank.
pub(super) fn name_schema() -> Value {
    json!({ "type": "string", "pattern": NAME_PATTERN })
}

/// Linear RGB.
pub(super) fn rgb_schema() -> Value {
    json!({
        "type": "array",
        "items": { "type": "number", "minimum": 0, "maximum": f32::MAX },
        "minItems": 3,
        "maxItems": 3,
    })
}
