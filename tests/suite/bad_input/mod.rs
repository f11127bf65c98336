//! What people type wrong and what machines lack: one clear message, the right exit code, nothing
//! half written.

use std::collections::HashSet;

use crate::harness::{Ran, Workshop};

mod arguments;
mod disk;
mod frames;
mod inputs;
mod manifest;
mod output;
mod pipes;
#[cfg(unix)]
mod special;
mod surface;

/// Runs what cannot start; the messages must have these texts.
#[track_caller]
fn refused(workshop: &Workshop, arguments: &[&str], expected: &[&str]) -> Ran {
    let ran = workshop.run(arguments).expect(2);
    let errors = ran.errors();
    for text in expected {
        assert!(errors.contains(text), "nothing of `{text}` in:\n{errors}");
    }
    assert!(ran.text().is_empty(), "{}", ran.text());
    assert!(!errors.contains("panicked"), "{errors}");
    let mut lines = HashSet::new();
    for line in errors.lines().filter(|l| l.starts_with("error: ")) {
        assert!(lines.insert(line), "printed twice:\n{errors}");
        assert!(!line.ends_with('.'), "{line}");
    }
    assert!(!lines.is_empty(), "{errors}");
    ran
}

/// The same for `render in` with these options; nothing may be left behind.
#[track_caller]
fn not_rendered(workshop: &Workshop, options: &[&str], expected: &[&str]) {
    let render = ["render", "in", "-o", "out/f.####.exr"];
    refused(workshop, &[&render, options].concat(), expected);
    assert!(!workshop.join("out").exists(), "a refused job leaves nothing");
}
