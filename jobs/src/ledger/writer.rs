//! Writes ledgers.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::files::{COMPACTED, LedgerFile, ledger_path};
use super::{Ledger, LedgerEntry};
use crate::{JobError, publish_with};

/// Appends to the ledger of one worker. No other worker writes to it.
#[derive(Debug)]
pub(crate) struct LedgerWriter {
    path: PathBuf,
    /// None before the first line.
    file: Option<File>,
    /// Length up to the last complete line.
    length: u64,
    /// When the file was last synced.
    last_sync: Option<Instant>,
    /// Whether all entries are synced.
    is_synced: bool,
}

/// Shortest time between two syncs. A power cut loses the entries of this time, which is less than most frames
/// take.
const SYNC_INTERVAL: Duration = Duration::from_millis(100);

impl LedgerWriter {
    /// A writer for the ledger of `worker`. The file is created with its first line.
    pub(crate) fn new(dir: &Path, worker: &str) -> Self {
        Self {
            path: ledger_path(dir, worker),
            file: None,
            length: 0,
            last_sync: None,
            is_synced: true,
        }
    }

    /// Appends the entry, which then survives a kill of this process. The file is synced, which makes the entry
    /// visible to other machines, if `sync_now` is set or if the last sync is long ago. After an error the ledger
    /// is unchanged.
    pub(crate) fn append(&mut self, entry: &LedgerEntry, sync_now: bool) -> Result<(), JobError> {
        let line = to_line(&self.path, entry)?;
        let failed = |e| JobError::io(&self.path, "writing the ledger", e);
        let file = match &mut self.file {
            Some(file) => file,
            None => self.file.insert(create(&self.path).map_err(failed)?),
        };
        // Truncate what a failed append may have left, so that lines are not joined
        let written = file
            .set_len(self.length)
            .and_then(|()| file.seek(SeekFrom::Start(self.length)))
            .and_then(|_| file.write_all(&line));
        // Sync if requested, or if the last time is long ago
        let is_due = sync_now || self.last_sync.is_none_or(|at| at.elapsed() >= SYNC_INTERVAL);
        self.is_synced = is_due;
        let written = written.and_then(|()| if is_due { file.sync_data() } else { Ok(()) });
        if is_due {
            self.last_sync = Some(Instant::now());
        }
        // After a failure, remove the torn line at once if possible
        if let Err(error) = written {
            let _ = file.set_len(self.length);
            return Err(failed(error));
        }
        self.length += line.len() as u64;
        Ok(())
    }

    /// Syncs all entries to disk.
    pub(crate) fn sync(&mut self) -> Result<(), JobError> {
        if let (Some(file), false) = (&self.file, self.is_synced) {
            let synced = file.sync_data();
            synced.map_err(|e| JobError::io(&self.path, "writing the ledger", e))?;
            self.is_synced = true;
        }
        Ok(())
    }
}

impl Drop for LedgerWriter {
    /// If the sync fails, the operating system still writes the entries later.
    fn drop(&mut self) {
        let _ = self.sync();
    }
}

/// Worker names are never reused, so the file cannot exist.
fn create(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(path)
}

fn to_line(path: &Path, entry: &LedgerEntry) -> Result<Vec<u8>, JobError> {
    let mut line = serde_json::to_vec(entry)
        .map_err(|source| JobError::Serialize { path: path.to_owned(), source })?;
    line.push(b'\n');
    Ok(line)
}

/// Compacts the ledgers `files` of ended workers into one; `ledger` has their entries. A worker that only seems
/// to have ended loses at most its last entries: their frames are repeated.
pub(crate) fn compact(dir: &Path, ledger: &Ledger, files: &[LedgerFile]) -> Result<(), JobError> {
    let path = ledger_path(dir, COMPACTED);
    let mut entries: Vec<&LedgerEntry> = ledger.entries().collect();
    entries.sort_by_key(|entry| (entry.seq, entry.frame));
    let written = publish_with(&path, |file| {
        entries.into_iter().try_for_each(|entry| {
            let line = to_line(&path, entry).map_err(io::Error::other)?;
            file.write_all(&line)
        })
    });
    written.map_err(|e: io::Error| JobError::io(&path, "writing the ledger", e))?;
    for file in files.iter().filter(|file| file.path != path) {
        remove(file)?;
    }
    Ok(())
}

/// Removes a ledger.
pub(crate) fn remove(file: &LedgerFile) -> Result<(), JobError> {
    match fs::remove_file(&file.path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => {
            Err(JobError::io(&file.path, "removing the ledger", e))
        }
        _ => Ok(()),
    }
}
