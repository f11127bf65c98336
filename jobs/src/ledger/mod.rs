//! The ledger: one JSON line for each frame that was finished or failed, only ever appended, one file a
//! worker so that workers never share one. Readers merge the files; the last word on a frame counts.
//!
//! A torn last line is what a kill leaves, and is dropped. Anything else that cannot be read is
//! an error: silently starting over would throw finished work away.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::JobError;

mod entry;
mod files;
mod news;
#[cfg(test)]
mod tests;
mod writer;

pub use entry::{Details, Entry, OutputFile, Status};
pub(crate) use files::{ENDED, LedgerFile, ledger_files, outputs_of, parse_lines};
use files::{Mark, read_entries};
pub(crate) use news::News;
pub(crate) use writer::{LedgerWriter, fold, remove};

/// The last word on every frame, merged from all workers.
#[derive(Debug, Clone, Default)]
pub struct Ledger {
    last: BTreeMap<i64, Entry>,
    next_seq: u64,
    /// How far each file was read.
    read: BTreeMap<PathBuf, Mark>,
}

/// Times that reading begins again because a ledger was taken into another one meanwhile.
const RETRIES: u32 = 20;

impl Ledger {
    /// Reads and merges all ledgers in `dir`.
    ///
    /// # Errors
    /// [`JobError::LedgerDamaged`] for a whole line that is not an entry.
    pub fn read(dir: &Path) -> Result<Self, JobError> {
        for _ in 0..RETRIES {
            if let Some(ledger) = Self::read_all(dir)? {
                return Ok(ledger);
            }
        }
        let gone = std::io::ErrorKind::NotFound.into();
        Err(JobError::io(
            dir,
            "reading ledgers, which keep vanishing",
            gone,
        ))
    }

    /// None if a file went away.
    fn read_all(dir: &Path) -> Result<Option<Self>, JobError> {
        let mut ledger = Self::default();
        for LedgerFile { path, .. } in ledger_files(dir)? {
            let mut mark = Mark::default();
            if !read_entries(&path, &mut mark, |entry| ledger.take_in(entry))? {
                return Ok(None);
            }
            ledger.read.insert(path, mark);
        }
        Ok(Some(ledger))
    }

    /// The last word on `frame`.
    pub fn entry(&self, frame: i64) -> Option<&Entry> {
        self.last.get(&frame)
    }

    /// The last word on every frame that has one, ascending by frame.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.last.values()
    }

    /// Of two words that did not know of each other, one that a frame is done counts, or else that of the
    /// file read later; files are read by name.
    pub(crate) fn take_in(&mut self, entry: Entry) {
        self.next_seq = self.next_seq.max(entry.seq.saturating_add(1));
        let known = self.last.get(&entry.frame);
        let word = (entry.seq, entry.status);
        if known.is_none_or(|known| news::supersedes(word, (known.seq, known.status))) {
            self.last.insert(entry.frame, entry);
        }
    }
}
