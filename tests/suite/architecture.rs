//! Modules use only those others that ARCHITECTURE.md lists, and none uses itself by way of others.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

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
    let (_, after) = text
        .split_once("Modules use only these others")
        .expect("the list");
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

/// Adds the `crate::` paths in the files under `path`, tests excluded, to what `module` uses.
fn collect(path: &Path, module: &str, modules: &BTreeSet<String>, uses: &mut Uses) {
    if path.is_dir() {
        for entry in fs::read_dir(path).expect("a directory") {
            collect(&entry.expect("an entry").path(), module, modules, uses);
        }
        return;
    }
    let name = path.to_string_lossy();
    if !name.ends_with(".rs") || name.ends_with("tests.rs") || name.contains("/tests/") {
        return;
    }
    let text = fs::read_to_string(path).expect("readable");
    let code = text
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default();
    let lines = code
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    for path in lines.flat_map(|line| line.split("crate::").skip(1)) {
        let end = path
            .find(|c: char| !c.is_alphanumeric() && c != '_')
            .unwrap_or(path.len());
        let other = &path[..end];
        if other != module && modules.contains(other) {
            uses.entry(module.to_owned())
                .or_default()
                .insert(other.to_owned());
        }
    }
}

/// What the modules in `src` use.
fn actual() -> Uses {
    let source = root().join("src");
    let entries: Vec<_> = fs::read_dir(&source)
        .expect("src")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    let module = |path: &Path| {
        path.file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
    };
    let modules: BTreeSet<String> = entries
        .iter()
        .filter_map(|path| module(path))
        .filter(|name| name != "lib" && name != "main")
        .collect();
    let mut uses: Uses = modules
        .iter()
        .map(|m| (m.clone(), BTreeSet::new()))
        .collect();
    for path in &entries {
        let name = module(path).expect("a name");
        if modules.contains(&name) {
            collect(path, &name, &modules, &mut uses);
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
    assert!(
        !actual.values().any(|used| used.contains(CLI)),
        "{actual:?}"
    );
    assert_eq!(
        documented(),
        actual,
        "ARCHITECTURE.md (left) and src (right) differ"
    );
}

#[test]
fn no_module_uses_itself_by_way_of_others() {
    let mut left = actual();
    while !left.is_empty() {
        // Remove a module that uses none of those left; in a cycle there is none
        let is_leaf = |used: &BTreeSet<String>| used.is_disjoint(&left.keys().cloned().collect());
        let leaf = left
            .iter()
            .find(|(_, used)| is_leaf(used))
            .map(|(m, _)| m.clone());
        let Some(leaf) = leaf else {
            panic!("these modules use each other: {left:#?}");
        };
        left.remove(&leaf);
    }
}
