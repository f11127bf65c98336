//! Which frames of a running simulation are complete.
//!
//! A file counts as complete when it has stood unchanged for a while by our own clock: what other
//! clocks say of it may be wrong. A simulator that pauses for longer in the middle of a file gives a
//! frame that cannot be read; once its file changes again, it is tried again.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use spherule_formats::Sequence;

/// Length and time of modification.
type Stamp = (u64, Option<SystemTime>);

/// The files of a frame as they were seen.
#[derive(Debug)]
struct Seen {
    stamps: Vec<Option<Stamp>>,
    since: Instant,
    /// Whether these very files have been handed out.
    is_handed_out: bool,
}

/// Frames as they come.
#[derive(Debug)]
pub(super) struct Arrivals {
    settle: Duration,
    seen: BTreeMap<i64, Seen>,
    /// When something was last seen to change.
    pub(super) changed: Instant,
}

impl Arrivals {
    /// Files are complete when they have stood unchanged for `settle`.
    pub(super) fn new(settle: Duration) -> Self {
        Self {
            settle,
            seen: BTreeMap::new(),
            changed: Instant::now(),
        }
    }

    /// Looks at the files of all frames at the time `now`.
    pub(super) fn look(&mut self, sequence: &Sequence, now: Instant) {
        let mut known: HashMap<PathBuf, Option<Stamp>> = HashMap::new();
        for (index, frame) in sequence.frames().iter().enumerate() {
            let paths = sequence.inputs(index).into_iter();
            let stamps: Vec<_> = paths
                .map(|path| *known.entry(path.to_owned()).or_insert_with(|| stamp(path)))
                .collect();
            let fresh = Seen {
                stamps,
                since: now,
                is_handed_out: false,
            };
            match self.seen.get_mut(&frame.number) {
                Some(seen) if seen.stamps == fresh.stamps => continue,
                Some(seen) => *seen = fresh,
                None => {
                    self.seen.insert(frame.number, fresh);
                }
            }
            self.changed = now;
        }
    }

    /// Whether `frame` is complete at the time `now`.
    pub(super) fn is_complete(&self, frame: i64, now: Instant) -> bool {
        self.seen
            .get(&frame)
            .is_some_and(|seen| now.duration_since(seen.since) >= self.settle)
    }

    /// Whether every frame seen is complete at the time `now`.
    pub(super) fn all_complete(&self, now: Instant) -> bool {
        self.seen.keys().all(|frame| self.is_complete(*frame, now))
    }

    /// The complete frames that have not been handed out as they are now, ascending.
    pub(super) fn take(&mut self, now: Instant) -> Vec<i64> {
        let settle = self.settle;
        let mut frames = Vec::new();
        for (frame, seen) in &mut self.seen {
            if !seen.is_handed_out && now.duration_since(seen.since) >= settle {
                seen.is_handed_out = true;
                frames.push(*frame);
            }
        }
        frames
    }
}

fn stamp(path: &Path) -> Option<Stamp> {
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
    fn complete_is_what_stands_still() {
        let dir = tempfile::tempdir().unwrap();
        let file = |frame: i64| dir.path().join(format!("f_{frame}.xyz"));
        fs::write(file(1), "0 0 0\n").unwrap();
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut arrivals = Arrivals::new(Duration::from_secs(2));
        arrivals.look(&sequence(dir.path()), at(0));
        assert!(arrivals.take(at(1)).is_empty() && !arrivals.all_complete(at(1)));
        fs::write(file(2), "0 0 0\n").unwrap();
        arrivals.look(&sequence(dir.path()), at(1));
        assert_eq!(arrivals.take(at(2)), [1]);
        fs::write(file(2), "0 0 0\n1 1 1\n").unwrap();
        arrivals.look(&sequence(dir.path()), at(2));
        assert!(arrivals.take(at(3)).is_empty(), "it has just grown");
        arrivals.look(&sequence(dir.path()), at(4));
        assert_eq!(arrivals.take(at(4)), [2]);
        assert_eq!(arrivals.changed, at(2));
        assert!(arrivals.take(at(9)).is_empty() && arrivals.all_complete(at(9)));
        // It was not complete after all.
        fs::write(file(2), "0 0 0\n1 1 1\n2 2 2\n").unwrap();
        arrivals.look(&sequence(dir.path()), at(9));
        assert_eq!(arrivals.take(at(11)), [2]);
    }
}
