//! Writing a ledger.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::files::{ENDED, LedgerFile, ledger_path};
use super::{Entry, Ledger};
use crate::{JobError, publish_with};

/// Appends to the ledger of one worker, which nobody else writes.
#[derive(Debug)]
pub(crate) struct LedgerWriter {
    path: PathBuf,
    /// None before the first line.
    file: Option<File>,
    /// Length up to the last whole line.
    length: u64,
    /// When the file was last synced, and whether nothing has been added since.
    synced: Option<Instant>,
    is_synced: bool,
}

/// Lines that come faster than this share a sync: a power cut then costs the frames of this long, which is
/// less than most frames take.
const SYNC: Duration = Duration::from_millis(100);

impl LedgerWriter {
    /// For the ledger of `worker`, which is made with its first line.
    pub(crate) fn new(dir: &Path, worker: &str) -> Self {
        Self {
            path: ledger_path(dir, worker),
            file: None,
            length: 0,
            synced: None,
            is_synced: true,
        }
    }

    /// The entry is in the file when this returns: a killed process leaves it. It is on the disk, too, and
    /// seen by other machines, if it `matters` at once, or if the last sync was a while ago. After an error
    /// the ledger is as before.
    pub(crate) fn append(&mut self, entry: &Entry, matters: bool) -> Result<(), JobError> {
        let line = line(entry)?;
        let failed = |e| JobError::io(&self.path, "writing the ledger", e);
        let file = match &mut self.file {
            Some(file) => file,
            None => self.file.insert(create(&self.path).map_err(failed)?),
        };
        // Cuts first what a failed append may have left: lines must not be glued together.
        let written = file
            .set_len(self.length)
            .and_then(|()| file.seek(SeekFrom::Start(self.length)))
            .and_then(|_| file.write_all(&line));
        let is_due = matters || self.synced.is_none_or(|at| at.elapsed() >= SYNC);
        self.is_synced = is_due;
        let written = written.and_then(|()| if is_due { file.sync_data() } else { Ok(()) });
        if is_due {
            self.synced = Some(Instant::now());
        }
        if let Err(error) = written {
            let _ = file.set_len(self.length);
            return Err(failed(error));
        }
        self.length += line.len() as u64;
        Ok(())
    }

    /// All entries are on the disk when this returns.
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
    /// What cannot be synced now the system writes a little later.
    fn drop(&mut self) {
        let _ = self.sync();
    }
}

/// A worker's name is its own for ever, so nothing of that name can be there.
fn create(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(path)
}

fn line(entry: &Entry) -> Result<Vec<u8>, JobError> {
    let mut line = serde_json::to_vec(entry)
        .map_err(|e| JobError::Request(format!("the entry cannot be written as JSON: {e}")))?;
    line.push(b'\n');
    Ok(line)
}

/// Brings the ledgers `files`, whose workers have ended, together in one; `ledger` is what they say. A
/// worker that only seems to have ended loses no more than its last words: its frame is made again.
pub(crate) fn fold(dir: &Path, ledger: &Ledger, files: &[LedgerFile]) -> Result<(), JobError> {
    let path = ledger_path(dir, ENDED);
    let mut entries: Vec<&Entry> = ledger.entries().collect();
    entries.sort_by_key(|entry| (entry.seq, entry.frame));
    let written = publish_with(&path, |file| {
        entries.into_iter().try_for_each(|entry| {
            let line = line(entry).map_err(|e| io::Error::other(e.to_string()))?;
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
