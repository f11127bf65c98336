//! What decides pixels does not ask the C library for elementary functions: its last bits differ from system to system.

use std::fs;
use std::path::{Path, PathBuf};

/// Methods of numbers that end in the C library.
const METHODS: [&str; 24] = [
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "cbrt", "cos", "cosh", "exp", "exp2",
    "exp_m1", "hypot", "ln", "ln_1p", "log", "log10", "log2", "powf", "sin", "sin_cos", "sinh",
    "tan", "tanh",
];

/// The rooms that decide pixels.
const ROOMS: [&str; 5] = [
    "crates/tree/src",
    "crates/tracer/src",
    "crates/images/src/output",
    "src/survey",
    "src/resolve",
];

fn rust_files(path: &Path, found: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).expect("a directory") {
            rust_files(&entry.expect("an entry").path(), found);
        }
    } else {
        let source = path.strip_prefix(env!("CARGO_MANIFEST_DIR")).expect("below the root");
        let name = source.to_string_lossy();
        let is_test = name.ends_with("tests.rs") || name.contains("/tests/");
        // Test support.
        let is_oracle = name.ends_with("solid.rs") || name.ends_with("brute.rs");
        if name.ends_with(".rs") && !is_test && !is_oracle {
            found.push(path.to_owned());
        }
    }
}

/// Calls of one of the methods in `text`, up to its tests.
fn calls(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let calls = |line: &str| METHODS.iter().any(|name| line.contains(&format!(".{name}(")));
    lines.filter(|line| calls(line)).map(str::to_owned).collect()
}

#[test]
fn pixels_do_not_depend_on_the_c_library() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for room in ROOMS {
        rust_files(&root.join(room), &mut files);
    }
    assert!(files.len() > 80, "{}", files.len());
    for file in files {
        let found = calls(&fs::read_to_string(&file).expect("readable"));
        assert!(
            found.is_empty(),
            "{}: {found:?}; see `math::functions` and the crate `libm`",
            file.display()
        );
    }
    assert_eq!(calls("let a = b.sin();\n// c.cos()\n#[cfg(test)]\nd.tan()"), ["let a = b.sin();"]);
}
