//! What other workers say while this one works.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::files::{Mark, ledger_files, ledger_path, read_entries};
use super::{Entry, Ledger, Status};
use crate::JobError;

/// How often a lone worker looks for ledgers of others that have come and gone.
const LOOK: Duration = Duration::from_secs(2);

/// As much of an entry as is asked for here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Word {
    seq: u64,
    time_ms: u64,
    frame: i64,
    status: Status,
    set_back: bool,
}

impl From<&Entry> for Word {
    fn from(entry: &Entry) -> Self {
        Self {
            seq: entry.seq,
            time_ms: entry.time_ms,
            frame: entry.frame,
            status: entry.status,
            set_back: entry.set_back,
        }
    }
}

/// The last word on each frame, kept up to date.
#[derive(Debug)]
pub(crate) struct News {
    dir: PathBuf,
    /// This worker's own, which it need not read.
    own: PathBuf,
    read: BTreeMap<PathBuf, Mark>,
    words: HashMap<i64, Word>,
    /// What had been said when this worker began, or when the frame was set back.
    old: HashMap<i64, Word>,
    next_seq: u64,
    looked: Instant,
    /// Whether there were other workers the last time.
    had_company: bool,
}

impl News {
    /// From what has been said so far.
    pub(crate) fn new(dir: &Path, worker: &str, ledger: &Ledger) -> Self {
        let words: HashMap<i64, Word> = ledger
            .entries()
            .map(|entry| (entry.frame, entry.into()))
            .collect();
        Self {
            dir: dir.to_owned(),
            own: ledger_path(dir, worker),
            read: ledger.read.clone(),
            old: words.clone(),
            words,
            next_seq: ledger.next_seq,
            looked: Instant::now(),
            had_company: true,
        }
    }

    /// How `frame` was ended by another worker since this one began, if it was.
    pub(crate) fn ended(&self, frame: i64) -> Option<Status> {
        let word = self.words.get(&frame)?;
        (self.old.get(&frame) != Some(word)).then_some(word.status)
    }

    /// A number for an entry that is to come after all known ones.
    pub(crate) fn take_seq(&mut self) -> u64 {
        let seq = self.next_seq;
        self.next_seq = seq.saturating_add(1);
        seq
    }

    /// Takes in what is new in the ledgers of these `workers` and of those known.
    pub(crate) fn refresh(&mut self, workers: &[String]) -> Result<(), JobError> {
        for worker in workers {
            self.know(ledger_path(&self.dir, worker));
        }
        // Among others, one may have come and gone since; alone, only seldom.
        let is_alone = workers.len() < 2 && !self.had_company;
        self.had_company = workers.len() > 1;
        let mut look = !is_alone || self.looked.elapsed() >= LOOK;
        loop {
            if look {
                self.looked = Instant::now();
                for file in ledger_files(&self.dir)? {
                    self.know(file.path);
                }
            }
            let is_gone = self.read_on()?;
            if look || !is_gone {
                return Ok(());
            }
            // Taken into another one.
            look = true;
        }
    }

    /// Takes in that this worker has set a frame back: how others ended it before is over.
    pub(crate) fn set_back(&mut self, entry: &Entry) {
        self.take_in(entry.into());
    }

    fn know(&mut self, path: PathBuf) {
        if path != self.own {
            self.read.entry(path).or_default();
        }
    }

    /// Whether one that had lines is gone.
    fn read_on(&mut self) -> Result<bool, JobError> {
        let mut is_gone = false;
        let mut read = std::mem::take(&mut self.read);
        let mut fault = None;
        read.retain(|path, mark| {
            match read_entries(path, mark, |entry| self.take_in((&entry).into())) {
                Ok(true) => true,
                // Not written yet, or gone.
                Ok(false) => {
                    is_gone |= *mark != Mark::default();
                    false
                }
                Err(error) => {
                    fault = Some(error);
                    true
                }
            }
        });
        self.read = read;
        fault.map_or(Ok(is_gone), Err)
    }

    fn take_in(&mut self, word: Word) {
        self.next_seq = self.next_seq.max(word.seq.saturating_add(1));
        let known = self.words.get(&word.frame);
        if known.is_none_or(|known| supersedes((word.seq, word.status), (known.seq, known.status)))
        {
            self.words.insert(word.frame, word);
            if word.set_back {
                self.old.insert(word.frame, word);
            }
        }
    }
}

/// Whether a word of this `seq` and status is the last one, not the other.
pub(super) fn supersedes(word: (u64, Status), known: (u64, Status)) -> bool {
    // Two that did not know of each other: what is there is there.
    word.0 > known.0 || (word.0 == known.0 && word.1 == Status::Done)
}
