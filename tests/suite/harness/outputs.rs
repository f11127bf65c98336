//! What a job's directory holds.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde_json::Value;

/// All files in `dir` with their bytes, by name.
pub(crate) fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let read = |entry: fs::DirEntry| Some((name(&entry), fs::read(entry.path()).ok()?));
    entries(dir).into_iter().filter_map(read).collect()
}

/// The images and previews in `dir`, by name.
pub(crate) fn images(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = files(dir);
    all.retain(|name, _| {
        let extension = Path::new(name).extension().and_then(|e| e.to_str());
        !name.starts_with('.') && matches!(extension, Some("exr" | "png"))
    });
    all
}

/// The native frames in `dir`, by name.
pub(crate) fn natives(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = files(dir);
    all.retain(|name, _| !name.starts_with('.') && name.ends_with(".spf"));
    all
}

/// When each file in `dir` was written.
pub(crate) fn stamps(dir: &Path) -> BTreeMap<String, SystemTime> {
    let stamp = |entry: fs::DirEntry| Some((name(&entry), entry.metadata().ok()?.modified().ok()?));
    entries(dir).into_iter().filter_map(stamp).collect()
}

/// Fails the test if `dir` has temporary files or claims.
#[track_caller]
pub(crate) fn no_leftovers(dir: &Path) {
    let is_left =
        |name: &String| name.starts_with('.') || name.ends_with(".part") || name == "job.work";
    let left: Vec<String> = entries(dir).iter().map(name).filter(is_left).collect();
    assert!(left.is_empty(), "{left:?}");
}

/// The ledger of a job as scripts see it.
pub(crate) struct Ledger {
    /// The whole lines.
    pub(crate) lines: Vec<Value>,
    /// Whether an unfinished line follows somewhere.
    pub(crate) torn: bool,
}

impl Ledger {
    /// Names and lengths of finished files in the lines.
    pub(crate) fn done(&self) -> Vec<(String, u64)> {
        let outputs = |line: &Value| line["outputs"].as_array().cloned().unwrap_or_default();
        self.lines
            .iter()
            .filter(|line| line["status"] == "done")
            .flat_map(outputs)
            .map(|o| {
                let path = o["path"].as_str().expect("a path").to_owned();
                (path, o["len"].as_u64().expect("a length"))
            })
            .collect()
    }
}

/// The ledgers in `dir`, one file a worker.
pub(crate) fn ledger_paths(dir: &Path) -> Vec<PathBuf> {
    let is_ledger = |name: &String| name.starts_with("job.ledger.") && name.ends_with(".jsonl");
    let mut names: Vec<String> = entries(dir).iter().map(name).filter(is_ledger).collect();
    names.sort();
    names.into_iter().map(|name| dir.join(name)).collect()
}

/// The only ledger in `dir`.
#[track_caller]
pub(crate) fn ledger_path(dir: &Path) -> PathBuf {
    let paths = ledger_paths(dir);
    assert_eq!(paths.len(), 1, "{paths:?}");
    paths[0].clone()
}

/// The content of all ledgers in `dir`.
pub(crate) fn ledger(dir: &Path) -> Ledger {
    let mut ledger = Ledger { lines: Vec::new(), torn: false };
    for path in ledger_paths(dir) {
        let text = fs::read_to_string(path).unwrap_or_default();
        let whole = text.rfind('\n').map_or(0, |at| at + 1);
        let parse = |line: &str| serde_json::from_str(line).expect("a whole line is JSON");
        ledger.lines.extend(text[..whole].lines().map(parse));
        ledger.torn |= whole < text.len();
    }
    ledger
}

fn entries(dir: &Path) -> Vec<fs::DirEntry> {
    fs::read_dir(dir).map_or_else(|_| Vec::new(), |list| list.filter_map(Result::ok).collect())
}

fn name(entry: &fs::DirEntry) -> String {
    entry.file_name().to_string_lossy().into_owned()
}
