//! The files of the ledgers.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::Entry;
use crate::{JobError, open_regular};

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

/// Longer lines are none of ours: a reason of a kilobyte is a long one.
const MAX_LINE: u64 = 16 << 20;

/// Reads the whole lines of the ledger at `path` that come after `mark`, and moves it; another ledger of
/// the same name is read from its beginning. False if it is gone.
pub(crate) fn read_entries(
    path: &Path,
    mark: &mut Mark,
    take: impl FnMut(Entry),
) -> Result<bool, JobError> {
    let failed = |e| JobError::io(path, "reading the ledger", e);
    let mut reader = match open_at(path, mark) {
        Ok(reader) => reader,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(e) => return Err(failed(e)),
    };
    read_lines(&mut reader, mark, take).map_err(|fault| match fault {
        LineFault::Io(e) => failed(e),
        LineFault::Damaged(line, what) => JobError::LedgerDamaged {
            path: path.to_owned(),
            line,
            what,
        },
    })?;
    Ok(true)
}

/// Why lines cannot be read.
enum LineFault {
    Io(io::Error),
    /// The line, from 1, and why.
    Damaged(usize, String),
}

/// The same of what is in memory.
pub(crate) fn parse_lines(mut bytes: &[u8]) -> Result<Vec<Entry>, (usize, String)> {
    let mut entries = Vec::new();
    match read_lines(&mut bytes, &mut Mark::default(), |e| entries.push(e)) {
        Ok(()) => Ok(entries),
        Err(LineFault::Damaged(line, what)) => Err((line, what)),
        Err(LineFault::Io(e)) => Err((0, e.to_string())),
    }
}

/// Reads whole lines; what follows the last one was never finished.
fn read_lines(
    reader: &mut impl BufRead,
    mark: &mut Mark,
    mut take: impl FnMut(Entry),
) -> Result<(), LineFault> {
    let mut line = Vec::new();
    loop {
        line.clear();
        let mut limited = Read::by_ref(reader).take(MAX_LINE);
        let read = limited.read_until(b'\n', &mut line);
        let length = read.map_err(LineFault::Io)? as u64;
        if !line.ends_with(b"\n") && length < MAX_LINE {
            return Ok(());
        }
        let entry = if length < MAX_LINE {
            Entry::parse(&line)
        } else {
            Err(format!("not a ledger entry (longer than {MAX_LINE} bytes)"))
        };
        take(entry.map_err(|what| LineFault::Damaged(mark.lines + 1, what))?);
        mark.lines += 1;
        mark.bytes += length;
    }
}

/// All outputs that the ledger at `path` says were made, as they stand there.
pub(crate) fn outputs_of(path: &Path) -> Result<Vec<String>, JobError> {
    let mut outputs = Vec::new();
    read_entries(path, &mut Mark::default(), |entry| {
        outputs.extend(entry.outputs.into_iter().map(|file| file.path));
    })?;
    Ok(outputs)
}

/// The ledger at `path` from `mark` on, which is set to the beginning of another file of that name.
fn open_at(path: &Path, mark: &mut Mark) -> io::Result<BufReader<File>> {
    let (mut file, metadata) = open_regular(path)?;
    let number = file_number(&metadata);
    if number != mark.file || metadata.len() < mark.bytes {
        *mark = Mark {
            file: number,
            ..Mark::default()
        };
    }
    file.seek(SeekFrom::Start(mark.bytes))?;
    Ok(BufReader::with_capacity(1 << 16, file))
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
