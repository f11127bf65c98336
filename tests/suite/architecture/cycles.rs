//! There are no dependency cycles between the files of a crate.
//!
//! A file depends on the files that its `crate::`, `super::` and `self::` paths lead to, also through names that a
//! parent imports or re-exports. Dependencies between a module and its descendants do not count.

use std::collections::{BTreeMap, BTreeSet};

use super::paths::{absolute, imports, rooted_paths};
use super::root;
use super::source::{ModulePath, code, files};

/// Directories of crates, and how many files they have at least.
const SOURCES: [(&str, usize); 17] = [
    ("src", 100),
    ("jobs/src", 30),
    ("formats/src", 30),
    ("crates/files/src", 8),
    ("crates/frame/src", 12),
    ("crates/compression/src", 8),
    ("crates/readers/src", 100),
    ("crates/tree/src", 50),
    ("crates/surface/src", 40),
    ("crates/tracer/src", 100),
    ("crates/gpu/src", 8),
    ("crates/images/src", 40),
    ("crates/selection/src", 8),
    ("crates/manifest/src", 40),
    ("crates/report/src", 15),
    ("crates/survey/src", 15),
    ("crates/scale/src", 15),
];

/// The modules of a crate.
struct Modules {
    code: BTreeMap<ModulePath, String>,
    /// Absolute paths of imported names, by module.
    imports: BTreeMap<ModulePath, BTreeMap<String, ModulePath>>,
}

impl Modules {
    fn new(files: Vec<(ModulePath, String)>) -> Self {
        let imports = files.iter().map(|(module, code)| {
            let imported = imports(code).into_iter().map(|path| absolute(module, path));
            let named = imported.filter_map(|path| Some((path.last()?.clone(), path)));
            (module.clone(), named.collect())
        });
        Self { imports: imports.collect(), code: files.into_iter().collect() }
    }

    /// The module that defines the item at an absolute `path`.
    fn owner(&self, path: &[String], steps: usize) -> ModulePath {
        let is_module = |length: &usize| self.code.contains_key(&path[..*length]);
        let length = (1..=path.len()).rev().find(is_module).unwrap_or(0);
        let (module, names) = path.split_at(length);
        let imported = names
            .split_first()
            .and_then(|(name, rest)| Some([self.imports.get(module)?.get(name)?, rest].concat()));
        match imported {
            Some(path) if steps > 0 => self.owner(&path, steps - 1),
            _ => module.to_vec(),
        }
    }

    /// Modules that `module` depends on, without its ancestors and descendants.
    fn used_by(&self, module: &ModulePath, code: &str) -> BTreeSet<ModulePath> {
        /// Limit for chains of re-exports.
        const STEPS: usize = 8;
        let owners =
            rooted_paths(code).into_iter().map(|path| self.owner(&absolute(module, path), STEPS));
        owners.filter(|owner| !module.starts_with(owner) && !owner.starts_with(module)).collect()
    }

    /// Sets of modules that depend on each other.
    fn cycles(&self) -> BTreeSet<BTreeSet<String>> {
        let used =
            |(module, code): (&ModulePath, &String)| (module.clone(), self.used_by(module, code));
        let uses: BTreeMap<_, _> = self.code.iter().map(used).collect();
        let reached: BTreeMap<_, _> =
            uses.keys().map(|module| (module, reached(module, &uses))).collect();
        let cycle = |module: &&ModulePath| -> BTreeSet<String> {
            let others = reached[*module].iter().filter(|other| reached[other].contains(*module));
            others.map(|other| other.join("::")).collect()
        };
        let cycles = reached.keys().map(cycle);
        cycles.filter(|cycle| !cycle.is_empty()).collect()
    }
}

/// Modules that `module` depends on, directly or indirectly.
fn reached(
    module: &ModulePath,
    uses: &BTreeMap<ModulePath, BTreeSet<ModulePath>>,
) -> BTreeSet<ModulePath> {
    let mut reached = BTreeSet::new();
    let mut left: Vec<&ModulePath> = uses[module].iter().collect();
    while let Some(other) = left.pop() {
        if reached.insert(other.clone()) {
            left.extend(&uses[other]);
        }
    }
    reached
}

#[test]
fn files_have_no_dependency_cycles() {
    for (source, min_count) in SOURCES {
        let files = files(&root().join(source));
        assert!(files.len() >= min_count, "{source}: {} files", files.len());
        let found = Modules::new(files).cycles();
        assert!(found.is_empty(), "{source}: files depend on each other: {found:?}");
    }
}

fn cycles(files: &[(&str, &str)]) -> Vec<String> {
    let file = |(module, text): &(&str, &str)| {
        let names = module.split("::").filter(|name| !name.is_empty());
        (names.map(str::to_owned).collect(), code(text))
    };
    let cycles = Modules::new(files.iter().map(file).collect()).cycles();
    cycles.into_iter().map(|cycle| Vec::from_iter(cycle).join(" ")).collect()
}

#[test]
fn cycles_are_found() {
    let root = ("", "mod a;\nmod b;\npub use a::{Thing, other::Thing as Other};\n");
    let a = ("a", "use super::{\n    b::Number,\n};\nuse super::a::deep;\n");
    let with_b = |code: &str| cycles(&[root, a, ("b", code)]);
    assert!(with_b("pub use crate::Unknown;\n").is_empty());
    assert!(with_b("// use crate::a::Thing;\n").is_empty());
    assert!(with_b("#[cfg(test)]\nmod tests {\nuse crate::a::Thing;\n").is_empty());
    assert_eq!(with_b("use crate::a::Thing;\n"), ["a b"]);
    assert_eq!(with_b("fn f() { super::a::g() }\n"), ["a b"]);
    // By a re-export of the parent.
    assert_eq!(with_b("use super::{Nothing, Thing as It};\n"), ["a b"]);
    // Three files, and nested lists.
    let three = [
        ("a", "use crate::{x, b::{c, d::e}};"),
        ("b::d", "use super::super::c;"),
        ("c", "use crate::a::f;"),
    ];
    assert_eq!(cycles(&three), ["a b::d c"]);
    // A list ends at its own brace.
    let two = [("b", "use crate::c::T;"), ("c", "use crate::{n::{o}};\nuse glam::{x, b};")];
    assert!(cycles(&two).is_empty());
}
