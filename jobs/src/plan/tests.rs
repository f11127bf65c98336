//! Plans that are stored and loaded, damaged, edited, or of another version.

use std::fs;

use super::*;

fn plan() -> Plan {
    let frame = |number| PlannedFrame {
        number,
        inputs: vec![PlannedInput { path: format!("in/{number}.vtk"), fingerprint: None }],
        outputs: vec![format!("f.{number}.exr")],
    };
    Plan::new(
        vec![("a".into(), "1".into())],
        serde_json::json!({ "radius": 0.1_f32, "eye": [1.0e-300, 0.1 + 0.2] }),
        vec!["/data/in".to_owned()],
        vec![frame(-1), frame(4)],
    )
}

/// A plan as spherule 0.1.0 writes it.
fn version_1() -> String {
    let mut value = serde_json::to_value(plan()).unwrap();
    value["version"] = 1.into();
    value["settings_blake3"] = settings_hash(plan().settings()).into();
    value.as_object_mut().unwrap().remove("input_dirs");
    serde_json::to_string_pretty(&value).unwrap()
}

#[test]
fn a_loaded_plan_is_identical() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(Plan::load(dir.path()).unwrap(), None);
    plan().store(dir.path()).unwrap();
    let loaded = Plan::load(dir.path()).unwrap().unwrap();
    assert_eq!(loaded, plan());
    assert_eq!(loaded.frame(4).unwrap().outputs, ["f.4.exr"]);
    assert_eq!(loaded.frame(3), None);
}

#[track_caller]
fn refused(text: &str, what: &str) {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join(PLAN_FILE), text).unwrap();
    let error = Plan::load(dir.path()).unwrap_err().to_string();
    assert!(error.contains(what), "{error}");
}

#[test]
fn damage_is_an_error() {
    let text = String::from_utf8(plan().to_bytes().unwrap()).unwrap();
    refused("", "not a readable plan");
    refused("[]", "not a readable plan");
    refused(&text[..text.len() - 9], "not a readable plan");
    refused(&text.replace("\"version\": 2", "\"version\": 9"), "version 9");
    refused(&text.replace("\"version\": 2", "\"version\": 1"), "not a readable plan");
    refused(&text.replace("f.4.exr", "f.5.exr"), "checksum");
    refused(&text.replace("\"blake3\": \"", "\"blake3\": \"0"), "checksum");
}

/// With any bit flipped the plan is refused or still means the same.
#[test]
fn no_flipped_bit_changes_a_plan() {
    let bytes = plan().to_bytes().unwrap();
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            match Plan::parse(&damaged) {
                Ok(read) => assert_eq!(read, plan(), "byte {at}, bit {bit}"),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}

#[test]
fn plans_of_version_1_are_read() {
    let read = Plan::parse(version_1().as_bytes()).unwrap();
    assert_eq!(read.frames(), plan().frames());
    assert_eq!(read.resolved(), plan().resolved());
    assert!(read.input_dirs().is_empty());
    assert_ne!(read, plan(), "it must be written again");
    let text = version_1();
    refused(&text.replace("\"1\"", "\"2\""), "fingerprint");
    refused(&text.replace("\"number\": -1", "\"number\": 5"), "ascending");
}

#[test]
fn merge_keeps_order() {
    let mut plan = plan();
    let frame = |number, output: &str| PlannedFrame {
        number,
        inputs: Vec::new(),
        outputs: vec![output.to_owned()],
    };
    plan.merge(vec![frame(9, "new"), frame(4, "other"), frame(0, "new")]);
    let numbers: Vec<i64> = plan.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [-1, 0, 4, 9]);
    assert_eq!(plan.frame(4).unwrap().outputs, ["other"]);
}
