//! Broken files: each gives its named error, or the particles that are left, and none costs memory
//! or a panic.
//!
//! `tests/damaged` holds the files and `table.tsv`, a line for each: the name, then text that
//! the error must have, or `reads K kept D dropped`. `SPHERULE_BLESS=1` writes the files anew
//! from the module `make`; the table is written by hand.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use spherule_formats::stats::FrameStats;
use spherule_formats::{FrameError, FrameFile};

use crate::harness::Workshop;

mod harm;
mod make;

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/damaged")
}

/// Names and what they must give.
fn table() -> Vec<(String, String)> {
    let text = fs::read_to_string(directory().join("table.tsv")).expect("the table");
    let lines = text.lines().filter(|l| !l.is_empty());
    lines
        .map(|line| {
            let (name, expected) = line.split_once('\t').expect("a name, a tab and a message");
            (name.to_owned(), expected.to_owned())
        })
        .collect()
}

/// Whether `found` is what the table has: counts exactly, and an error by the text it must have.
fn agrees(found: &str, expected: &str) -> bool {
    let counts = expected.starts_with("reads ");
    found == expected || !counts && found.contains(expected)
}

/// All steps of the file at `path`, as the table has it.
fn outcome(path: &Path) -> String {
    match read_all(path, FrameFile::open(path)) {
        Ok((kept, dropped)) => format!("reads {kept} kept {dropped} dropped"),
        Err(error) => {
            let message = error.to_string();
            let prefix = format!("{}: ", path.display());
            let what = message.strip_prefix(&prefix);
            what.expect("an error begins with the path").to_owned()
        }
    }
}

/// Particles kept and dropped over all steps.
fn read_all(path: &Path, file: Result<FrameFile, FrameError>) -> Result<(u64, u64), FrameError> {
    let file = file?;
    assert_eq!(file.path(), path);
    let mut sum = (0, 0);
    for index in 0..file.steps().len() {
        let stats = FrameStats::of(&file.read(index)?);
        sum = (sum.0 + stats.count, sum.1 + stats.dropped);
    }
    Ok(sum)
}

#[test]
fn every_damaged_file_gives_its_expected_error() {
    let made = make::files();
    if std::env::var_os("SPHERULE_BLESS").is_some() {
        for (name, bytes) in &made {
            fs::write(directory().join(name), bytes).expect("a file");
        }
    }
    let table = table();
    let mut wrong = Vec::new();
    for (name, expected) in &table {
        let found = outcome(&directory().join(name));
        if !agrees(&found, expected) {
            wrong.push(format!("{name}\t{found}"));
        }
    }
    assert!(wrong.is_empty(), "these differ from the table:\n{}", wrong.join("\n"));

    let sorted = |names: Vec<String>| {
        let mut names = names;
        names.sort();
        names
    };
    let listed = sorted(table.into_iter().map(|(name, _)| name).collect());
    let makeable = sorted(made.into_iter().map(|(name, _)| name).collect());
    assert_eq!(listed, makeable, "the table and the files that are made");
    let entries = fs::read_dir(directory()).expect("the directory");
    let there: Vec<String> = entries
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name != "table.tsv")
        .collect();
    assert_eq!(sorted(there), listed, "the directory and the table");
}

/// A count in a file must not become an allocation: the program has far less memory than the
/// counts ask for.
#[test]
#[cfg(target_os = "linux")]
fn program_reports_every_error_in_bounded_memory() {
    let table = table();
    let workshop = Workshop::new();
    let program = workshop.command(&[]);
    // In KiB; the counts ask for 20 GB and more.
    let script = "ulimit -v 1500000 && exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh"]).arg(program.get_program());
    command.env("RAYON_NUM_THREADS", "2").current_dir(directory());
    command.args(["inspect", "--json"]).args(table.iter().map(|(name, _)| name));
    let output = command.output().expect("a shell");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.is_empty(), "{errors}");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let objects: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    // Files of several steps have an object for each
    let mut files = objects.chunk_by(|a, b| a["file"] == b["file"]);
    for (name, expected) in &table {
        let steps = files.next().expect("an object for each file");
        let object = steps.last().expect("chunks are not empty");
        assert_eq!(object["file"], name.as_str());
        if let Some(counts) = expected.strip_prefix("reads ") {
            let sum = |key: &str| steps.iter().filter_map(|step| step[key].as_u64()).sum::<u64>();
            let message = format!("{} kept {} dropped", sum("count"), sum("dropped"));
            assert_eq!(message, counts, "{name}");
        } else {
            let message = object["error"].as_str().unwrap_or_else(|| panic!("{name}: {object}"));
            assert!(message.starts_with(&format!("{name}: ")), "{message}");
            assert!(message.contains(expected), "{message}");
            assert_eq!(object.as_object().map(serde_json::Map::len), Some(2), "{name}");
        }
    }
    assert_eq!(files.next(), None);
}

/// For people the same goes to standard error, and nothing to standard output.
#[test]
fn program_prints_errors_as_text() {
    let (name, expected) = table().into_iter().find(|(_, e)| !e.starts_with("reads")).expect("one");
    let mut command = Workshop::new().command(&["inspect", &name]);
    let output = command.current_dir(directory()).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.starts_with(&format!("error: {name}: ")), "{message}");
    assert!(message.contains(&expected), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(output.stdout.is_empty());
}
