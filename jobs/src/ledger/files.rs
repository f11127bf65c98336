//! Finds and reads ledger files.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::LedgerEntry;
use crate::{EntryError, JobError, open_regular};

/// The worker name in the file name of the compacted ledger.
pub(crate) const COMPACTED: &str = "ended";

/// The path of the ledger of `worker`.
pub(crate) fn ledger_path(dir: &Path, worker: &str) -> PathBuf {
    dir.join(format!("job.ledger.{worker}.jsonl"))
}

/// The worker whose ledger has this file name.
fn worker_of(name: &str) -> Option<&str> {
    let worker = name.strip_prefix("job.ledger.")?.strip_suffix(".jsonl")?;
    (!worker.is_empty()).then_some(worker)
}

/// An existing ledger.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LedgerFile {
    pub(crate) path: PathBuf,
    /// The worker that writes it.
    pub(crate) worker: String,
    /// Length, bytes.
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
                    // Another worker has compacted it meanwhile
                    Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                    Err(e) => return Err(e),
                };
                found.push(LedgerFile { path: entry.path(), worker: worker.to_owned(), length });
            }
        }
        found.sort();
        Ok(found)
    };
    list().map_err(|e| JobError::io(dir, "listing ledgers", e))
}

/// How far a ledger has been read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ReadPosition {
    /// Identifies the file: a compacted ledger replaces the previous one.
    file: u64,
    bytes: u64,
    lines: usize,
}

/// Bytes of the longest line that is accepted. Lines with a long reason have a few kilobytes.
const MAX_LINE: u64 = 16 << 20;

/// Reads the complete lines of the ledger at `path` after `position`, and advances it. If the file was replaced,
/// reads it from the beginning. Returns false if the file does not exist.
pub(crate) fn read_entries(
    path: &Path,
    position: &mut ReadPosition,
    add: impl FnMut(LedgerEntry),
) -> Result<bool, JobError> {
    let failed = |e| JobError::io(path, "reading the ledger", e);
    let mut reader = match open_at(path, position) {
        Ok(reader) => reader,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(failed(e)),
    };
    read_lines(&mut reader, position, add).map_err(|(line, error)| match error {
        EntryError::Io(e) => failed(e),
        source => JobError::LedgerDamaged { path: path.to_owned(), line, source },
    })?;
    Ok(true)
}

/// Parses the complete lines of a ledger in memory.
pub(crate) fn parse_lines(mut bytes: &[u8]) -> Result<Vec<LedgerEntry>, (usize, EntryError)> {
    let mut entries = Vec::new();
    read_lines(&mut bytes, &mut ReadPosition::default(), |entry| {
        entries.push(entry);
    })?;
    Ok(entries)
}

/// Reads complete lines. An incomplete last line was never finished. The error has the line number, from 1.
fn read_lines(
    reader: &mut impl BufRead,
    position: &mut ReadPosition,
    mut add: impl FnMut(LedgerEntry),
) -> Result<(), (usize, EntryError)> {
    let mut line = Vec::new();
    loop {
        let at_line = |error| (position.lines + 1, error);
        // Read a line, but never more than the longest that is allowed
        line.clear();
        let mut limited = Read::by_ref(reader).take(MAX_LINE);
        let read = limited.read_until(b'\n', &mut line);
        let length = read.map_err(|e| at_line(e.into()))? as u64;
        // Leave an incomplete line for the next time
        if !line.ends_with(b"\n") && length < MAX_LINE {
            return Ok(());
        }
        let entry = if length < MAX_LINE {
            LedgerEntry::parse(&line)
        } else {
            Err(EntryError::TooLong { max: MAX_LINE })
        };
        add(entry.map_err(at_line)?);
        position.lines += 1;
        position.bytes += length;
    }
}

/// Reads the paths of all outputs in the ledger at `path`.
pub(crate) fn read_outputs(path: &Path) -> Result<Vec<String>, JobError> {
    let mut outputs = Vec::new();
    read_entries(path, &mut ReadPosition::default(), |entry| {
        outputs.extend(entry.outputs.into_iter().map(|file| file.path));
    })?;
    Ok(outputs)
}

/// Opens the ledger at `path` at `position`. Resets the position if the file was replaced.
fn open_at(path: &Path, position: &mut ReadPosition) -> io::Result<BufReader<File>> {
    let (mut file, metadata) = open_regular(path)?;
    let number = file_number(&metadata);
    if number != position.file || metadata.len() < position.bytes {
        *position = ReadPosition { file: number, ..ReadPosition::default() };
    }
    file.seek(SeekFrom::Start(position.bytes))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Identifies a file on its file system.
#[cfg(unix)]
fn file_number(metadata: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(metadata)
}

/// Not available on this system.
#[cfg(not(unix))]
fn file_number(_metadata: &fs::Metadata) -> u64 {
    0
}
