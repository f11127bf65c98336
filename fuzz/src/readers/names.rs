//! Patterns and names of input files: which of them are frames, by their names alone.

use std::collections::{BTreeSet, HashSet};
use std::path::Path;

use spherule_formats::SequenceError;
use spherule_formats::sequence::{frames_of_list, frames_of_names, lone_frame_number};

/// Bytes of the longest name that file systems take.
const LONGEST: usize = 255;

/// The first line is a pattern, or empty for a directory or a list; every other line is a file's name.
pub fn names(bytes: &[u8]) -> usize {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.split('\n');
    let pattern = lines.next().filter(|line| !line.is_empty());
    // As in a directory: each once, in order.
    let names: BTreeSet<&str> = lines.filter(|name| is_possible(name)).collect();
    let names: Vec<&Path> = names.into_iter().map(Path::new).collect();
    for name in names.iter().take(16) {
        lone_frame_number(name);
    }
    let listed = frames_of_list(&names).map(|frames| check(&frames, &names));
    let found = match pattern {
        Some(pattern) => frames_of_names(Some(Path::new(pattern)), &names),
        None => frames_of_names(None, &names),
    };
    refused(listed) + refused(found.map(|frames| check(&frames, &names)))
}

/// What a directory can hold.
fn is_possible(name: &str) -> bool {
    let is_reserved = matches!(name, "" | "." | "..");
    name.len() <= LONGEST && !is_reserved && !name.contains(['/', '\0'])
}

/// Frames are files that are there, each once.
fn check(frames: &[(std::path::PathBuf, Option<i64>, u32)], names: &[&Path]) -> usize {
    let mut paths: Vec<&Path> = frames.iter().map(|(path, ..)| path.as_path()).collect();
    paths.sort_unstable();
    let names: HashSet<&Path> = names.iter().copied().collect();
    assert!(paths.iter().all(|path| names.contains(path)));
    assert!(paths.is_sorted_by(|a, b| a < b), "a file twice");
    frames.len()
}

fn refused(frames: Result<usize, SequenceError>) -> usize {
    frames.unwrap_or_else(|error| {
        assert!(!error.to_string().is_empty());
        0
    })
}
