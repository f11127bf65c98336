//! Paths in source code.

use super::source::ModulePath;

/// The absolute form of a `path` that is written in `module`.
pub(super) fn absolute(module: &[String], path: ModulePath) -> ModulePath {
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

/// Paths in `code` that start with `crate`, `super` or `self`.
pub(super) fn rooted_paths(code: &str) -> Vec<ModulePath> {
    let mut found = Vec::new();
    for root in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(root) {
            let is_start = !code[..at].ends_with(|c: char| c == ':' || is_name_char(c));
            if is_start {
                paths_of_tree(&mut &code[at..], Vec::new(), &mut found);
            }
        }
    }
    found
}

/// Paths that `code` imports or re-exports.
pub(super) fn imports(code: &str) -> Vec<ModulePath> {
    let mut found = Vec::new();
    for (at, keyword) in code.match_indices("use ") {
        let line = code[..at].rsplit('\n').next().unwrap_or_default().trim();
        if line.is_empty() || line.starts_with("pub") {
            paths_of_tree(&mut &code[at + keyword.len()..], Vec::new(), &mut found);
        }
    }
    found
}

/// Removes a tree like `a::{b, c::d}` from the start of `rest` and adds its paths, prefixed with `path`, to `found`.
fn paths_of_tree(rest: &mut &str, mut path: ModulePath, found: &mut Vec<ModulePath>) {
    loop {
        *rest = rest.trim_start();
        if let Some(list) = rest.strip_prefix('{') {
            *rest = list;
            return paths_of_list(rest, &path, found);
        }
        let end = rest.find(|c| !is_name_char(c)).unwrap_or(rest.len());
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

/// Removes a list from the start of `rest`, up to and including its closing brace.
fn paths_of_list(rest: &mut &str, path: &ModulePath, found: &mut Vec<ModulePath>) {
    while !rest.trim_start().starts_with('}') && !rest.is_empty() {
        paths_of_tree(rest, path.clone(), found);
        // Skip an alias and the comma
        *rest = rest.trim_start_matches(|c| c != ',' && c != '}').trim_start_matches(',');
    }
    let end = rest.trim_start();
    *rest = end.strip_prefix('}').unwrap_or(end);
}

fn is_name_char(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
