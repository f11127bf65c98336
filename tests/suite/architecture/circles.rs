//! No file of a crate uses itself by way of others.
//!
//! A file uses what its `crate::`, `super::` and `self::` paths lead to, also through the names that a parent imports
//! or exports again. What lies between a parent and the files below it does not count.

use std::collections::{BTreeMap, BTreeSet};

use super::root;
use super::source::{ModulePath, code, files};

/// Files of a crate that use each other, and why they may.
struct Allowed {
    source: &'static str,
    files: &'static [&'static str],
    why: &'static str,
}

const SOURCES: [&str; 3] = ["src", "jobs/src", "formats/src"];

const ALLOWED: &[Allowed] = &[
    Allowed {
        source: "src",
        files: &[
            "manifest::key",
            "manifest::list",
            "manifest::reader",
            "manifest::value",
        ],
        why: "one declaration of a key reads it and lists it, and a kind of value reads itself from a field",
    },
    Allowed {
        source: "jobs/src",
        files: &["workers::claim", "workers::registry"],
        why: "a claim is released at the registry that it was made at",
    },
    Allowed {
        source: "formats/src",
        files: &["attribute", "scalar"],
        why: "a type of numbers and the columns of that type make one another",
    },
    Allowed {
        source: "formats/src",
        files: &[
            "detect",
            "open",
            "read::csv",
            "read::input",
            "read::lammps",
            "read::remarks",
            "read::table",
            "read::xyz",
            "unpack",
        ],
        why: "detection asks the readers of text, which open packed files",
    },
    Allowed {
        source: "formats/src",
        files: &[
            "read::vtk::attributes",
            "read::vtk::keywords",
            "read::vtk::payload",
        ],
        why: "keywords end a payload of text and begin attributes",
    },
    Allowed {
        source: "formats/src",
        files: &[
            "read::vtk_xml::blocks",
            "read::vtk_xml::compressor",
            "read::vtk_xml::document",
        ],
        why: "the document names encodings, whose messages quote the document",
    },
    Allowed {
        source: "formats/src",
        files: &[
            "sequence::error",
            "sequence::group",
            "sequence::pattern",
            "sequence::scan",
        ],
        why: "messages about a sequence give a hint from its groups of files",
    },
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
        Self {
            imports: imports.collect(),
            code: files.into_iter().collect(),
        }
    }

    /// The module that has what an absolute `path` names.
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

    /// Other modules that `module` uses, its parents and those below it excluded.
    fn used_by(&self, module: &ModulePath, code: &str) -> BTreeSet<ModulePath> {
        /// More than any name is exported again.
        const STEPS: usize = 8;
        let owners = rooted_paths(code)
            .into_iter()
            .map(|path| self.owner(&absolute(module, path), STEPS));
        owners
            .filter(|owner| !module.starts_with(owner) && !owner.starts_with(module))
            .collect()
    }

    /// Sets of modules that use each other.
    fn circles(&self) -> BTreeSet<BTreeSet<String>> {
        let used =
            |(module, code): (&ModulePath, &String)| (module.clone(), self.used_by(module, code));
        let uses: BTreeMap<_, _> = self.code.iter().map(used).collect();
        let reached: BTreeMap<_, _> = uses
            .keys()
            .map(|module| (module, reached(module, &uses)))
            .collect();
        let circle = |module: &&ModulePath| -> BTreeSet<String> {
            let others = reached[*module]
                .iter()
                .filter(|other| reached[other].contains(*module));
            others.map(|other| other.join("::")).collect()
        };
        let circles = reached.keys().map(circle);
        circles.filter(|circle| !circle.is_empty()).collect()
    }
}

/// Modules that `module` uses, itself or by way of others.
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

/// `path` as it is written in `module`, from the root of the crate.
fn absolute(module: &[String], path: ModulePath) -> ModulePath {
    let mut whole = module.to_vec();
    for name in path {
        match &name[..] {
            "crate" => whole.clear(),
            "super" => drop(whole.pop()),
            "self" => {}
            _ => whole.push(name),
        }
    }
    whole
}

/// Paths in `code` that begin at the root of the crate, the parent or the module itself.
fn rooted_paths(code: &str) -> Vec<ModulePath> {
    let mut found = Vec::new();
    for root in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(root) {
            let is_begin = !code[..at].ends_with(|c: char| c == ':' || is_of_name(c));
            if is_begin {
                paths_of_tree(&mut &code[at..], Vec::new(), &mut found);
            }
        }
    }
    found
}

/// Paths that `code` imports or exports again.
fn imports(code: &str) -> Vec<ModulePath> {
    let mut found = Vec::new();
    for (at, keyword) in code.match_indices("use ") {
        let line = code[..at].rsplit('\n').next().unwrap_or_default().trim();
        if line.is_empty() || line.starts_with("pub") {
            paths_of_tree(&mut &code[at + keyword.len()..], Vec::new(), &mut found);
        }
    }
    found
}

/// Takes a tree like `a::{b, c::d}` off the beginning of `rest` and adds its paths, which continue `path`, to `found`.
fn paths_of_tree(rest: &mut &str, mut path: ModulePath, found: &mut Vec<ModulePath>) {
    loop {
        *rest = rest.trim_start();
        if let Some(list) = rest.strip_prefix('{') {
            *rest = list;
            return paths_of_list(rest, &path, found);
        }
        let end = rest.find(|c| !is_of_name(c)).unwrap_or(rest.len());
        let (name, after) = rest.split_at(end);
        *rest = after;
        if !name.is_empty() {
            path.push(name.to_owned());
        }
        match after.strip_prefix("::") {
            Some(next) => *rest = next,
            None => break,
        }
    }
    found.push(path);
}

/// Takes the rest of a list in braces off the beginning of `rest`.
fn paths_of_list(rest: &mut &str, path: &ModulePath, found: &mut Vec<ModulePath>) {
    while !rest.trim_start().starts_with('}') && !rest.is_empty() {
        paths_of_tree(rest, path.clone(), found);
        // An alias, and the comma.
        *rest = rest
            .trim_start_matches(|c| c != ',' && c != '}')
            .trim_start_matches(',');
    }
    *rest = rest.trim_start().trim_start_matches('}');
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

#[test]
fn files_do_not_use_themselves_by_way_of_others() {
    for source in SOURCES {
        let files = files(&root().join(source));
        assert!(files.len() > 20, "{source}: {} files", files.len());
        let allowed = ALLOWED.iter().filter(|allowed| allowed.source == source);
        let allowed = allowed.map(|circle| {
            (
                circle.files.iter().map(|f| (*f).to_owned()).collect(),
                circle.why,
            )
        });
        let allowed: BTreeMap<BTreeSet<String>, &str> = allowed.collect();
        let found = Modules::new(files).circles();
        for circle in &found {
            assert!(
                allowed.contains_key(circle),
                "{source}: these files use each other: {circle:?}"
            );
        }
        for (circle, why) in &allowed {
            assert!(
                found.contains(circle),
                "{source}: no circle any more, remove it from the list: {circle:?} ({why})"
            );
        }
    }
}

#[test]
fn circles_are_found() {
    let circles = |files: &[(&str, &str)]| {
        let file = |(module, text): &(&str, &str)| {
            let path = module.split("::").filter(|name| !name.is_empty());
            (path.map(str::to_owned).collect(), code(text))
        };
        let circles = Modules::new(files.iter().map(file).collect()).circles();
        circles
            .into_iter()
            .map(|circle| Vec::from_iter(circle).join(" "))
            .collect::<Vec<_>>()
    };
    // Parents with what is below them, in a chain.
    let parent = (
        "",
        "mod a;\nmod b;\npub use a::{Thing, other::Thing as Other};\n",
    );
    let chain = (
        "a",
        "use super::{\n    b::Number,\n};\nuse super::a::deep;\n",
    );
    assert!(circles(&[parent, chain, ("b", "pub use crate::Unknown;\n")]).is_empty());
    // By a path, in a comment, in tests, in an expression, and by way of the parent.
    assert_eq!(
        circles(&[parent, chain, ("b", "use crate::a::Thing;\n")]),
        ["a b"]
    );
    assert!(circles(&[parent, chain, ("b", "// use crate::a::Thing;\n")]).is_empty());
    assert!(
        circles(&[
            parent,
            chain,
            ("b", "#[cfg(test)]\nmod tests {\nuse crate::a::Thing;\n")
        ])
        .is_empty()
    );
    assert_eq!(
        circles(&[parent, chain, ("b", "fn f() { super::a::g() }\n")]),
        ["a b"]
    );
    assert_eq!(
        circles(&[parent, chain, ("b", "use super::{Nothing, Thing as It};\n")]),
        ["a b"]
    );
    // Of three, with lists in lists.
    let three = [
        ("a", "use crate::{x, b::{c, d::e}};"),
        ("b::d", "use super::super::c;"),
        ("c", "use crate::a::f;"),
    ];
    assert_eq!(circles(&three), ["a b::d c"]);
}
