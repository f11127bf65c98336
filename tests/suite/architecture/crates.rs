//! The crates of the workspace depend on each other as ARCHITECTURE.md draws it, and none is too large to read.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::{Uses, documented, root, source};

/// Most lines of a crate, without comments at the end of lines and without tests.
const MAX_LINES: usize = 30_000;

/// Directories of the crates, by their names without `spherule-`.
fn crates() -> BTreeMap<String, PathBuf> {
    let below = fs::read_dir(root().join("crates"))
        .expect("a directory")
        .map(|entry| entry.expect("an entry").path());
    let others = ["formats", "jobs", "python", "."].map(|name| root().join(name));
    below.chain(others).map(|dir| (name_of(&dir), dir)).collect()
}

fn cargo_file(dir: &Path) -> toml::Table {
    let text = fs::read_to_string(dir.join("Cargo.toml")).expect("a Cargo file");
    text.parse().expect("a table")
}

/// The name of the package in `dir`, without `spherule-`.
fn name_of(dir: &Path) -> String {
    let name = cargo_file(dir)["package"]["name"].as_str().expect("a name").to_owned();
    short(&name).to_owned()
}

fn short(package: &str) -> &str {
    package.strip_prefix("spherule-").unwrap_or(package)
}

#[test]
fn crates_use_what_the_documentation_draws() {
    let crates = crates();
    assert!(crates.len() > 8, "{crates:?}");
    let used_by = |dir: &PathBuf| {
        let dependencies = cargo_file(dir)["dependencies"].as_table().cloned().unwrap_or_default();
        let names = dependencies.keys().map(|name| short(name).to_owned());
        names.filter(|name| crates.contains_key(name)).collect()
    };
    let actual: Uses = crates.iter().map(|(name, dir)| (name.clone(), used_by(dir))).collect();
    assert_eq!(documented("Crates use only these others"), actual, "ARCHITECTURE.md (left)");
}

#[test]
fn crates_are_small_enough_to_read() {
    for (name, dir) in crates().into_iter().filter(|(name, _)| name != "features") {
        let files = source::files(&dir.join("src"));
        let lines: usize = files.iter().map(|(_, code)| code.lines().count()).sum();
        assert!(lines > 100 && lines < MAX_LINES, "{name}: {lines} lines");
    }
}
