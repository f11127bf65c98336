//! Modules use only the modules that ARCHITECTURE.md lists, and there are no dependency cycles between modules or
//! files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

mod cycles;
mod paths;
mod source;

/// Other modules, by the module that uses them.
type Uses = BTreeMap<String, BTreeSet<String>>;

/// The module of printing and arguments, which may use all others.
const CLI: &str = "cli";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The list in ARCHITECTURE.md: a line per module, `-` for none.
fn documented() -> Uses {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let (_, after) = text.split_once("Modules use only these others").expect("the list");
    let lines = after.lines().skip_while(|line| !line.starts_with("    "));
    lines
        .take_while(|line| line.starts_with("    "))
        .map(|line| {
            let mut words = line.split_whitespace().map(str::to_owned);
            let module = words.next().expect("a module");
            (module, words.filter(|word| word != "-").collect())
        })
        .collect()
}

/// What the modules in `src` use.
fn actual() -> Uses {
    let files = source::files(&root().join("src"));
    // Others than the root and `main`.
    let rooms: BTreeSet<&String> = files.iter().filter_map(|(path, _)| path.first()).collect();
    let mut uses: Uses = rooms.iter().map(|room| ((*room).clone(), BTreeSet::new())).collect();
    for (path, code) in &files {
        let Some(room) = path.first() else { continue };
        for used in code.split("crate::").skip(1) {
            let end = used.find(|c: char| !c.is_alphanumeric() && c != '_');
            let other = used[..end.unwrap_or(used.len())].to_owned();
            if other != *room && rooms.contains(&other) {
                uses.entry(room.clone()).or_default().insert(other);
            }
        }
    }
    uses
}

#[test]
fn modules_use_what_the_documentation_lists() {
    let mut actual = actual();
    let cli = actual.remove(CLI).expect("the module of printing");
    assert!(cli.len() > 10, "{cli:?}");
    assert!(actual.len() > 12, "{actual:?}");
    assert!(!actual.values().any(|used| used.contains(CLI)), "{actual:?}");
    assert_eq!(documented(), actual, "ARCHITECTURE.md (left) and src (right) differ");
}

#[test]
fn modules_have_no_dependency_cycles() {
    let mut left = actual();
    while !left.is_empty() {
        // Remove a module that uses none of those left; in a cycle there is none
        let is_leaf = |used: &BTreeSet<String>| used.is_disjoint(&left.keys().cloned().collect());
        let leaf = left.iter().find(|(_, used)| is_leaf(used)).map(|(m, _)| m.clone());
        let Some(leaf) = leaf else {
            panic!("these modules use each other: {left:#?}");
        };
        left.remove(&leaf);
    }
}
