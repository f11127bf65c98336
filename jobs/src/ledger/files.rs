//! The files of the ledgers.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::JobError;

/// What the ledger is called that takes in those of workers that have ended.
pub(crate) const ENDED: &str = "ended";

/// Where the ledger of `worker` is.
pub(crate) fn ledger_path(dir: &Path, worker: &str) -> PathBuf {
    dir.join(format!("job.ledger.{worker}.jsonl"))
}

/// Whose ledger has this name.
fn worker_of(name: &str) -> Option<&str> {
    let worker = name.strip_prefix("job.ledger.")?.strip_suffix(".jsonl")?;
    (!worker.is_empty()).then_some(worker)
}

/// A ledger that is there.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LedgerFile {
    pub(crate) path: PathBuf,
    /// Whose it is.
    pub(crate) worker: String,
    /// Bytes.
    pub(crate) length: u64,
}

/// All ledgers in `dir`, by name.
pub(crate) fn ledger_files(dir: &Path) -> Result<Vec<LedgerFile>, JobError> {
    let list = || -> io::Result<Vec<LedgerFile>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(dir)? {
            let entry = entry?;
            let name = entry.file_name();
            if let Some(worker) = name.to_str().and_then(worker_of) {
                let length = match entry.metadata() {
                    Ok(metadata) => metadata.len(),
                    // Taken into another one meanwhile.
                    Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                    Err(e) => return Err(e),
                };
                found.push(LedgerFile {
                    path: entry.path(),
                    worker: worker.to_owned(),
                    length,
                });
            }
        }
        found.sort();
        Ok(found)
    };
    list().map_err(|e| JobError::io(dir, "looking for ledgers", e))
}

/// How far a ledger has been read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Mark {
    /// Which file it was: one that took in others has replaced that of its name.
    file: u64,
    bytes: u64,
    lines: usize,
}

/// Reads the whole lines of the ledger at `path` that come after `mark`, and moves it; another ledger of
/// the same name is read from its beginning. None if it is gone.
pub(crate) fn read_lines<T: DeserializeOwned>(
    path: &Path,
    mark: &mut Mark,
) -> Result<Option<Vec<T>>, JobError> {
    let read = |mark: &mut Mark| -> io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let metadata = file.metadata()?;
        let number = file_number(&metadata);
        if number != mark.file || metadata.len() < mark.bytes {
            *mark = Mark {
                file: number,
                ..Mark::default()
            };
        }
        file.seek(SeekFrom::Start(mark.bytes))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let bytes = match read(mark) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(JobError::io(path, "reading the ledger", e)),
    };
    let whole = &bytes[..whole_length(&bytes)];
    let mut entries = Vec::new();
    for line in whole.split_inclusive(|b| *b == b'\n') {
        mark.lines += 1;
        mark.bytes += line.len() as u64;
        let entry = serde_json::from_slice(line).map_err(|e| JobError::LedgerDamaged {
            path: path.to_owned(),
            line: mark.lines,
            what: format!("not a ledger entry ({e})"),
        })?;
        entries.push(entry);
    }
    Ok(Some(entries))
}

/// The same for the same file only.
#[cfg(unix)]
fn file_number(metadata: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(metadata)
}

/// Not known here.
#[cfg(not(unix))]
fn file_number(_metadata: &fs::Metadata) -> u64 {
    0
}

/// Bytes up to and with the last line feed; what follows is a line that was never finished.
fn whole_length(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1)
}
