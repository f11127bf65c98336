//! Detects the complete frames of a running simulation.
//!
//! A file counts as complete when it has not changed for some time by the clock of this machine; other clocks may be
//! wrong. If the simulator pauses longer in the middle of a file, the frame cannot be read. It is tried again when
//! its file changes.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use spherule_formats::Sequence;

/// Length and modification time.
type FileState = (u64, Option<SystemTime>);

/// The files of a frame when they were last checked.
#[derive(Debug)]
struct ObservedFrame {
    files: Vec<Option<FileState>>,
    unchanged_since: Instant,
    /// Whether the frame was returned with these files.
    is_returned: bool,
}

/// The frames of a growing sequence.
#[derive(Debug)]
pub(super) struct CompleteFrames {
    settle: Duration,
    observed: BTreeMap<i64, ObservedFrame>,
    /// When a change was last observed.
    pub(super) last_change: Instant,
}

impl CompleteFrames {
    /// Files are complete when they have not changed for `settle`.
    pub(super) fn new(settle: Duration) -> Self {
        Self { settle, observed: BTreeMap::new(), last_change: Instant::now() }
    }

    /// Checks the files of all frames at the time `now`.
    pub(super) fn update(&mut self, sequence: &Sequence, now: Instant) {
        let mut known: HashMap<PathBuf, Option<FileState>> = HashMap::new();
        for (index, frame) in sequence.frames().iter().enumerate() {
            let paths = sequence.inputs(index).into_iter();
            let files: Vec<_> = paths
                .map(|path| *known.entry(path.to_owned()).or_insert_with(|| file_state(path)))
                .collect();
            let current = ObservedFrame { files, unchanged_since: now, is_returned: false };
            match self.observed.get_mut(&frame.number) {
                Some(known) if known.files == current.files => continue,
                Some(known) => *known = current,
                None => {
                    self.observed.insert(frame.number, current);
                }
            }
            self.last_change = now;
        }
    }

    /// Whether `frame` is complete at the time `now`.
    pub(super) fn is_complete(&self, frame: i64, now: Instant) -> bool {
        self.observed
            .get(&frame)
            .is_some_and(|known| now.duration_since(known.unchanged_since) >= self.settle)
    }

    /// Whether all known frames are complete at the time `now`.
    pub(super) fn all_complete(&self, now: Instant) -> bool {
        self.observed.keys().all(|frame| self.is_complete(*frame, now))
    }

    /// The complete frames that are new or have changed since they were returned, ascending.
    pub(super) fn take_new(&mut self, now: Instant) -> Vec<i64> {
        let settle = self.settle;
        let mut frames = Vec::new();
        for (frame, known) in &mut self.observed {
            if !known.is_returned && now.duration_since(known.unchanged_since) >= settle {
                known.is_returned = true;
                frames.push(*frame);
            }
        }
        frames
    }
}

fn file_state(path: &Path) -> Option<FileState> {
    let metadata = fs::metadata(path).ok()?;
    Some((metadata.len(), metadata.modified().ok()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spherule_formats::SequenceInput;

    fn sequence(dir: &Path) -> Sequence {
        Sequence::open(&SequenceInput::from_path(dir)).unwrap()
    }

    #[test]
    fn unchanged_files_are_complete() {
        let dir = tempfile::tempdir().unwrap();
        let file = |frame: i64| dir.path().join(format!("f_{frame}.xyz"));
        fs::write(file(1), "0 0 0\n").unwrap();
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut frames = CompleteFrames::new(Duration::from_secs(2));
        frames.update(&sequence(dir.path()), at(0));
        assert!(frames.take_new(at(1)).is_empty() && !frames.all_complete(at(1)));
        fs::write(file(2), "0 0 0\n").unwrap();
        frames.update(&sequence(dir.path()), at(1));
        assert_eq!(frames.take_new(at(2)), [1]);
        fs::write(file(2), "0 0 0\n1 1 1\n").unwrap();
        frames.update(&sequence(dir.path()), at(2));
        assert!(frames.take_new(at(3)).is_empty(), "the file has just grown");
        frames.update(&sequence(dir.path()), at(4));
        assert_eq!(frames.take_new(at(4)), [2]);
        assert_eq!(frames.last_change, at(2));
        assert!(frames.take_new(at(9)).is_empty() && frames.all_complete(at(9)));
        // The file grows again
        fs::write(file(2), "0 0 0\n1 1 1\n2 2 2\n").unwrap();
        frames.update(&sequence(dir.path()), at(9));
        assert_eq!(frames.take_new(at(11)), [2]);
    }
}
