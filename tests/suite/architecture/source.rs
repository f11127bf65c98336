//! Source files of a crate.

use std::fs;
use std::path::Path;

/// The names of a module and its ancestors, such as `["accel", "simd"]`; empty for the root of a crate.
pub(super) type ModulePath = Vec<String>;

/// The files of a library under the directory `source` without tests, as modules and their code.
pub(super) fn files(source: &Path) -> Vec<(ModulePath, String)> {
    let mut found = Vec::new();
    collect(source, &[], &mut found);
    let for_tests: Vec<ModulePath> = found.iter().flat_map(test_modules).collect();
    found.retain(|(module, _)| !for_tests.iter().any(|path| module.starts_with(path)));
    found.sort();
    found
}

/// The modules that `code` declares for tests alone, in files of their own.
fn test_modules((module, code): &(ModulePath, String)) -> Vec<ModulePath> {
    let declarations = code.split("#[cfg(test)]\n").skip(1);
    // They are `mod name;` or `pub(crate) mod name;`
    let names = declarations.filter_map(|rest| {
        let (visibility, name) = rest.lines().next()?.split_once("mod ")?;
        name.strip_suffix(';').filter(|_| visibility.is_empty() || visibility.starts_with("pub"))
    });
    names.map(|name| [&module[..], &[name.to_owned()]].concat()).collect()
}

fn collect(dir: &Path, parents: &[String], found: &mut Vec<(ModulePath, String)>) {
    for entry in fs::read_dir(dir).expect("a directory") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_string_lossy();
        let mut module = parents.to_vec();
        if name == "main" {
            continue;
        }
        if name != "mod" && name != "lib" {
            module.push(name.to_string());
        }
        if path.is_dir() && name != "tests" {
            collect(&path, &module, found);
        }
        if path.extension().is_some_and(|e| e == "rs") && !name.ends_with("tests") {
            let text = fs::read_to_string(&path).expect("readable");
            found.push((module, code(&text)));
        }
    }
}

/// `text` without comments and without the tests at the end.
pub(super) fn code(text: &str) -> String {
    let lines: Vec<&str> =
        text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let code = lines.join("\n");
    let end = code.find("#[cfg(test)]\nmod tests {").unwrap_or(code.len());
    code[..end].to_owned()
}
