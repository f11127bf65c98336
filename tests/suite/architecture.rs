//! Crates and modules use only the others that ARCHITECTURE.md lists, and there are no dependency cycles between
//! modules or files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

mod crates;
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

/// Crates whose modules ARCHITECTURE.md lists, and how many modules each has at least.
const LISTED: [(&str, usize); 4] =
    [("crates/tree", 4), ("crates/tracer", 3), ("crates/images", 5), ("src", 7)];

/// The lines of ARCHITECTURE.md that are indented by four spaces, the first after `heading`.
fn list_after(heading: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let (_, after) = text.split_once(heading).expect("the heading of the list");
    let lines = after.lines().skip_while(|line| !line.starts_with("    "));
    lines.take_while(|line| line.starts_with("    ")).map(str::to_owned).collect()
}

/// A list of names and what they use, `-` for nothing.
fn documented(heading: &str) -> Uses {
    let lines = list_after(heading).into_iter().map(|line| {
        let mut names =
            line.split_whitespace().filter(|name| !matches!(*name, "-" | "->")).map(str::to_owned);
        (names.next().expect("a name"), names.collect())
    });
    lines.collect()
}

/// What the modules of the crate in `directory` use of the others.
fn actual(directory: &str) -> Uses {
    let source =
        if directory == "src" { root().join("src") } else { root().join(directory).join("src") };
    let files = source::files(&source);
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
    for (directory, min_count) in LISTED {
        let mut actual = actual(directory);
        if let Some(cli) = actual.remove(CLI) {
            assert!(cli.len() > 3, "{cli:?}");
        }
        assert!(actual.len() >= min_count, "{actual:?}");
        assert!(!actual.values().any(|used| used.contains(CLI)), "{actual:?}");
        let documented = documented(&format!("In `{directory}`:"));
        assert_eq!(documented, actual, "ARCHITECTURE.md (left) and {directory} (right) differ");
    }
}

#[test]
fn modules_have_no_dependency_cycles() {
    for (directory, _) in LISTED {
        let mut left = actual(directory);
        while !left.is_empty() {
            // Remove a module that uses none of those left; in a cycle there is none
            let is_leaf =
                |used: &BTreeSet<String>| used.is_disjoint(&left.keys().cloned().collect());
            let leaf = left.iter().find(|(_, used)| is_leaf(used)).map(|(m, _)| m.clone());
            let Some(leaf) = leaf else {
                panic!("these modules use each other: {left:#?}");
            };
            left.remove(&leaf);
        }
    }
}
