//! What simulations wrote, read by everything that users read with: one frame in every format,
//! samples of other projects, whole sequences, and a domain far from zero.

mod far;
mod inspect;
mod native;
mod public;
mod sequences;
mod single;

use std::fs;
use std::path::PathBuf;

use crate::harness::sample;

/// Names of the data files in a directory of samples, sorted.
#[track_caller]
fn data_files(directory: &str) -> Vec<String> {
    let entries = fs::read_dir(sample(directory)).expect("a directory of samples");
    let files = entries.map(|e| e.expect("an entry").path());
    let name = |path: PathBuf| path.file_name().map(|n| n.to_string_lossy().into_owned());
    let mut names: Vec<String> = files.filter(|p| p.is_file()).filter_map(name).collect();
    names.retain(|name| name != "README.md" && name != "LICENSE");
    names.sort();
    names
}
