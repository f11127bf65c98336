//! The files of a run: `scale.json`, `scale.csv`, `scale.html`. Each appears complete or not at all.

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde_json::Value;
use spherule_files::{Publisher, publish};

use super::{CSV, HTML, JSON, MADE_BY, ScaleReport, csv, page};

/// Recognises files of this program by their content.
type Mark = fn(&str) -> bool;

const OURS: [(&str, Mark); 3] = [(JSON, is_our_json), (CSV, is_our_csv), (HTML, is_our_page)];

/// Writes all files into `dir`, and replaces older ones.
///
/// # Errors
/// With the file that cannot be written.
pub fn write(dir: &Path, report: &ScaleReport) -> Result<(), (PathBuf, io::Error)> {
    let json = format!("{:#}\n", serde_json::json!(report));
    for (name, text) in [(JSON, json), (CSV, csv::text(report)), (HTML, page::html(report))] {
        let path = dir.join(name);
        publish(&path, text.as_bytes()).map_err(|e| (path, e))?;
    }
    Ok(())
}

/// Creates `dir` and checks that files can be created in it; no file remains.
///
/// # Errors
/// The error of the file system.
pub fn prepare(dir: &Path) -> io::Result<()> {
    fs::create_dir_all(dir)?;
    Publisher::create(&dir.join(JSON)).map(drop)
}

/// A file in `dir` under one of these names that this program has not made.
pub fn foreign(dir: &Path) -> Option<PathBuf> {
    OURS.into_iter().find_map(|(name, is_ours)| {
        let path = dir.join(name);
        let foreign = path.symlink_metadata().is_ok() && !read(&path).is_some_and(|t| is_ours(&t));
        foreign.then_some(path)
    })
}

/// Text up to a length that no report exceeds.
fn read(path: &Path) -> Option<String> {
    const MAX: u64 = 64 << 20;
    let mut text = String::new();
    let file = fs::File::open(path).ok()?;
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    file.take(MAX).read_to_string(&mut text).ok()?;
    Some(text)
}

fn is_our_json(text: &str) -> bool {
    serde_json::from_str::<Value>(text).is_ok_and(|v| v["made_by"] == MADE_BY)
}

fn is_our_csv(text: &str) -> bool {
    // Older versions may have other columns of numbers.
    text.starts_with("particles,structure,motion,")
}

fn is_our_page(text: &str) -> bool {
    text.contains(&format!("<title>{MADE_BY}"))
}
