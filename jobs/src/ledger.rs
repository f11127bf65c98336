//! The ledger: one JSON line for each frame that was finished or failed, only ever appended, one
//! file a worker so that workers never share one. Readers merge the files; the last word on a
//! frame counts.
//!
//! A torn last line is what a kill leaves, and is dropped. Anything else that cannot be read is
//! an error: silently starting over would throw finished work away.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::JobError;

/// How a frame ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// All its outputs are in place.
    Done,
    /// It could not be made; the reason is in the entry.
    Failed,
}

/// An output as it was when its frame was done.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Relative paths are in the job's directory.
    pub path: String,
    /// Length, bytes.
    pub len: u64,
}

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Larger than that of every line its writer knew of, in any file.
    pub seq: u64,
    /// When, milliseconds since 1970. For rates; the order is by `seq`.
    pub time_ms: u64,
    /// The frame's number.
    pub frame: i64,
    /// How it ended.
    pub status: Status,
    /// What was written, if done.
    #[serde(default)]
    pub outputs: Vec<OutputFile>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Means something to the caller only: timings, counts.
    #[serde(default)]
    pub details: Details,
}

/// JSON that means something to the caller only. Kept as text: as a tree of values it would take
/// several times the memory, for every frame of the job.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Details(Box<RawValue>);

impl Details {
    /// As a tree.
    pub fn value(&self) -> Value {
        serde_json::from_str(self.0.get()).expect("it was JSON when it was read or made")
    }
}

impl Default for Details {
    fn default() -> Self {
        Self(RawValue::NULL.to_owned())
    }
}

impl From<&Value> for Details {
    fn from(value: &Value) -> Self {
        let text = value.to_string();
        Self(RawValue::from_string(text).expect("a value is written as JSON"))
    }
}

impl PartialEq for Details {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

/// The last word on every frame, merged from all workers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ledger {
    last: BTreeMap<i64, Entry>,
    next_seq: u64,
}

impl Ledger {
    /// Reads and merges all ledgers in `dir`.
    ///
    /// # Errors
    /// [`JobError::LedgerDamaged`] for a whole line that is not an entry.
    pub fn read(dir: &Path) -> Result<Self, JobError> {
        let mut ledger = Self::default();
        for (path, _) in ledger_files(dir)? {
            ledger.read_file(&path)?;
        }
        Ok(ledger)
    }

    /// The last word on `frame`.
    pub fn entry(&self, frame: i64) -> Option<&Entry> {
        self.last.get(&frame)
    }

    /// The last word on every frame that has one, ascending by frame.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.last.values()
    }

    fn read_file(&mut self, path: &Path) -> Result<(), JobError> {
        let bytes = fs::read(path).map_err(|e| JobError::io(path, "reading the ledger", e))?;
        let whole = &bytes[..whole_length(&bytes)];
        for (index, line) in whole.split_inclusive(|b| *b == b'\n').enumerate() {
            let entry = serde_json::from_slice(line).map_err(|e| JobError::LedgerDamaged {
                path: path.to_owned(),
                line: index + 1,
                what: format!("not a ledger entry ({e})"),
            })?;
            self.take_in(entry);
        }
        Ok(())
    }

    /// Of two words with the same `seq` the later read counts; files are read by name.
    pub(crate) fn take_in(&mut self, entry: Entry) {
        self.next_seq = self.next_seq.max(entry.seq.saturating_add(1));
        let known = self.last.get(&entry.frame).map(|known| known.seq);
        if known.is_none_or(|seq| seq <= entry.seq) {
            self.last.insert(entry.frame, entry);
        }
    }

    /// An entry that comes after all known ones.
    pub(crate) fn next_entry(&self, frame: i64, status: Status, details: &Value) -> Entry {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        Entry {
            seq: self.next_seq,
            time_ms: since_1970.map_or(0, |t| u64::try_from(t.as_millis()).unwrap_or(u64::MAX)),
            frame,
            status,
            outputs: Vec::new(),
            reason: None,
            details: details.into(),
        }
    }
}

/// Appends to the ledger of one worker, which it holds locked.
#[derive(Debug)]
pub(crate) struct LedgerWriter {
    path: PathBuf,
    file: File,
    /// Length up to the last whole line.
    length: u64,
}

impl LedgerWriter {
    /// Opens or creates the worker's ledger and locks it; changes nothing in it yet.
    pub(crate) fn open(dir: &Path, worker: &str) -> Result<Self, JobError> {
        let path = ledger_path(dir, worker);
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(|e| JobError::io(&path, "opening the ledger", e))?;
        lock(&file, &path)?;
        Ok(Self {
            path,
            file,
            length: 0,
        })
    }

    /// Cuts off a torn last line and goes to the end. To be called once all ledgers have been
    /// read and found good.
    pub(crate) fn cut_torn_line(&mut self) -> Result<(), JobError> {
        let cut = |path: &Path, file: &mut File| -> io::Result<u64> {
            let bytes = fs::read(path)?;
            let whole = whole_length(&bytes);
            let length = u64::try_from(whole).unwrap_or(u64::MAX);
            if whole < bytes.len() {
                file.set_len(length)?;
                file.sync_data()?;
            }
            Ok(length)
        };
        self.length = cut(&self.path, &mut self.file)
            .map_err(|e| JobError::io(&self.path, "repairing the ledger", e))?;
        Ok(())
    }

    /// Empties this ledger and removes those of other workers.
    pub(crate) fn start_over(&mut self, dir: &Path) -> Result<(), JobError> {
        for (path, _) in ledger_files(dir)? {
            if path == self.path {
                continue;
            }
            let failed = |e| JobError::io(&path, "removing the ledger", e);
            let file = OpenOptions::new().write(true).open(&path).map_err(failed)?;
            lock(&file, &path)?;
            fs::remove_file(&path).map_err(failed)?;
        }
        let emptied = self.file.set_len(0).and_then(|()| self.file.sync_data());
        self.length = 0;
        emptied.map_err(|e| JobError::io(&self.path, "emptying the ledger", e))
    }

    /// The entry is on the disk when this returns. After an error the ledger is as before.
    pub(crate) fn append(&mut self, entry: &Entry) -> Result<(), JobError> {
        let mut line = serde_json::to_vec(entry)
            .map_err(|e| JobError::Request(format!("the entry cannot be written as JSON: {e}")))?;
        line.push(b'\n');
        // Cuts first what a failed append may have left: lines must not be glued together.
        let written = self
            .file
            .set_len(self.length)
            .and_then(|()| self.file.seek(SeekFrom::Start(self.length)))
            .and_then(|_| self.file.write_all(&line))
            .and_then(|()| self.file.sync_data());
        match written {
            Ok(()) => {
                self.length += u64::try_from(line.len()).unwrap_or(u64::MAX);
                Ok(())
            }
            Err(e) => {
                let _ = self.file.set_len(self.length);
                Err(JobError::io(&self.path, "writing the ledger", e))
            }
        }
    }
}

/// Refuses a ledger that another process holds; file systems without locks are let through.
fn lock(file: &File, path: &Path) -> Result<(), JobError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(JobError::Busy {
            path: path.to_owned(),
        }),
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

/// Bytes up to and with the last line feed; what follows is a line that was never finished.
fn whole_length(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1)
}

fn ledger_path(dir: &Path, worker: &str) -> PathBuf {
    dir.join(format!("job.ledger.{worker}.jsonl"))
}

/// All ledgers in `dir` with their lengths, by name.
pub(crate) fn ledger_files(dir: &Path) -> Result<Vec<(PathBuf, u64)>, JobError> {
    let list = || -> io::Result<Vec<(PathBuf, u64)>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(dir)? {
            let entry = entry?;
            let name = entry.file_name();
            let is_ledger = name
                .to_str()
                .and_then(|n| n.strip_prefix("job.ledger.")?.strip_suffix(".jsonl"))
                .is_some_and(|worker| !worker.is_empty());
            if is_ledger {
                found.push((entry.path(), entry.metadata()?.len()));
            }
        }
        found.sort();
        Ok(found)
    };
    list().map_err(|e| JobError::io(dir, "looking for ledgers", e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn append(dir: &Path, worker: &str, frame: i64, status: Status) {
        let ledger = Ledger::read(dir).unwrap();
        let mut writer = LedgerWriter::open(dir, worker).unwrap();
        writer.cut_torn_line().unwrap();
        let entry = ledger.next_entry(frame, status, &json!({ "by": worker }));
        writer.append(&entry).unwrap();
    }

    fn text(dir: &Path, worker: &str) -> String {
        fs::read_to_string(ledger_path(dir, worker)).unwrap()
    }

    #[test]
    fn the_last_word_counts_across_workers() {
        let dir = tempfile::tempdir().unwrap();
        append(dir.path(), "b", 1, Status::Failed);
        append(dir.path(), "a", 1, Status::Done);
        append(dir.path(), "a", -2, Status::Done);
        append(dir.path(), "b", -2, Status::Failed);
        fs::write(dir.path().join("job.ledger..jsonl"), "not ours").unwrap();
        fs::write(dir.path().join("job.plan.json"), "not ours").unwrap();
        let ledger = Ledger::read(dir.path()).unwrap();
        let frames: Vec<i64> = ledger.entries().map(|e| e.frame).collect();
        assert_eq!(frames, [-2, 1]);
        assert_eq!(ledger.entry(1).unwrap().status, Status::Done);
        assert_eq!(
            ledger.entry(1).unwrap().details.value(),
            json!({ "by": "a" })
        );
        assert_eq!(ledger.entry(-2).unwrap().status, Status::Failed);
    }

    #[test]
    fn a_torn_last_line_is_dropped_wherever_it_tore() {
        let dir = tempfile::tempdir().unwrap();
        append(dir.path(), "w", 1, Status::Done);
        let one = text(dir.path(), "w");
        append(dir.path(), "w", 2, Status::Done);
        let two = text(dir.path(), "w");
        for length in one.len()..two.len() {
            fs::write(ledger_path(dir.path(), "w"), &two[..length]).unwrap();
            let ledger = Ledger::read(dir.path()).unwrap();
            assert!(ledger.entry(1).is_some() && ledger.entry(2).is_none());
            append(dir.path(), "w", 3, Status::Done);
            let ledger = Ledger::read(dir.path()).unwrap();
            assert_eq!(ledger.entries().count(), 2, "torn at {length}");
            assert!(text(dir.path(), "w").starts_with(&one));
        }
        // Power loss may leave zeros where the line was to be.
        fs::write(ledger_path(dir.path(), "w"), format!("{one}\0\0\0\0")).unwrap();
        assert_eq!(Ledger::read(dir.path()).unwrap().entries().count(), 1);
    }

    #[test]
    fn damage_in_the_middle_is_an_error_and_nothing_is_touched() {
        let dir = tempfile::tempdir().unwrap();
        append(dir.path(), "w", 1, Status::Done);
        append(dir.path(), "w", 2, Status::Done);
        let good = text(dir.path(), "w");
        let cases = [
            (good.replacen("\"frame\":1", "\"frame\":?", 1), 1),
            (good.replacen("done", "dome", 1), 1),
            (format!("{good}\n{good}"), 3),
            (format!("{good}\0\0\n"), 3),
            (format!("{good}[]\n"), 3),
        ];
        for (damaged, wanted) in cases {
            fs::write(ledger_path(dir.path(), "w"), &damaged).unwrap();
            let error = Ledger::read(dir.path()).unwrap_err();
            assert!(
                matches!(&error, JobError::LedgerDamaged { line, .. } if *line == wanted),
                "{error}"
            );
            assert!(error.to_string().contains("job.ledger.w.jsonl"));
            assert_eq!(text(dir.path(), "w"), damaged);
        }
    }

    #[test]
    fn a_worker_name_is_held_once() {
        let dir = tempfile::tempdir().unwrap();
        let held = LedgerWriter::open(dir.path(), "w").unwrap();
        assert!(matches!(
            LedgerWriter::open(dir.path(), "w"),
            Err(JobError::Busy { .. })
        ));
        let mut other = LedgerWriter::open(dir.path(), "v").unwrap();
        assert!(matches!(
            other.start_over(dir.path()),
            Err(JobError::Busy { .. })
        ));
        drop(held);
        other.start_over(dir.path()).unwrap();
        assert!(!ledger_path(dir.path(), "w").exists());
    }
}
