//! The ledger: one JSON line per finished or failed frame. Lines are only appended, and each worker has a file of
//! its own. Readers merge the files; the latest entry of a frame counts.
//!
//! A kill may leave an incomplete last line, which is ignored. Anything else that cannot be read is an error:
//! to start over silently would discard finished work.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::JobError;

mod entry;
mod files;
#[cfg(test)]
mod tests;
mod watcher;
mod writer;

pub use entry::{Details, EntryStatus, LedgerEntry, OutputFile};
pub(crate) use files::{COMPACTED, LedgerFile, ledger_files, parse_lines, read_outputs};
use files::{ReadPosition, read_entries};
pub(crate) use watcher::LedgerWatcher;
pub(crate) use writer::{LedgerWriter, compact, remove};

/// The latest entry of each frame, merged from all workers.
#[derive(Debug, Clone, Default)]
pub struct Ledger {
    latest: BTreeMap<i64, LedgerEntry>,
    next_seq: u64,
    /// How far each file was read.
    positions: BTreeMap<PathBuf, ReadPosition>,
}

/// Attempts to read all ledgers; an attempt fails if another worker compacts ledgers meanwhile.
const MAX_ATTEMPTS: u32 = 20;

impl Ledger {
    /// Reads and merges all ledgers in `dir`.
    ///
    /// # Errors
    /// [`JobError::LedgerDamaged`] for a whole line that is not an entry.
    pub fn read(dir: &Path) -> Result<Self, JobError> {
        for _ in 0..MAX_ATTEMPTS {
            if let Some(ledger) = Self::read_all(dir)? {
                return Ok(ledger);
            }
        }
        let not_found = std::io::ErrorKind::NotFound.into();
        Err(JobError::io(dir, "reading ledgers, which are being removed", not_found))
    }

    /// None if a file was removed meanwhile.
    fn read_all(dir: &Path) -> Result<Option<Self>, JobError> {
        let mut ledger = Self::default();
        for LedgerFile { path, .. } in ledger_files(dir)? {
            let mut position = ReadPosition::default();
            if !read_entries(&path, &mut position, |entry| ledger.merge(entry))? {
                return Ok(None);
            }
            ledger.positions.insert(path, position);
        }
        Ok(Some(ledger))
    }

    /// The latest entry of `frame`.
    pub fn entry(&self, frame: i64) -> Option<&LedgerEntry> {
        self.latest.get(&frame)
    }

    /// The latest entries, ascending by frame.
    pub fn entries(&self) -> impl Iterator<Item = &LedgerEntry> {
        self.latest.values()
    }

    /// Adds an entry if it supersedes the known one of its frame. Of two entries with the same sequence number
    /// the one that says "done" counts.
    pub(crate) fn merge(&mut self, entry: LedgerEntry) {
        self.next_seq = self.next_seq.max(entry.seq.saturating_add(1));
        let known = self.latest.get(&entry.frame);
        let new = (entry.seq, entry.status);
        if known.is_none_or(|known| watcher::supersedes(new, (known.seq, known.status))) {
            self.latest.insert(entry.frame, entry);
        }
    }
}
