//! What makes a frame the frame it was: its input files and the settings of the job.
//!
//! A file is told by length, time of modification, and a BLAKE3 of its length, first and last
//! 64 KiB: cheap for files of gigabytes, and a rewritten file changes at least one of the three.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use crate::{SettingChange, open_regular};

const SAMPLE_BYTES: u64 = 64 * 1024;

/// Enough of a file to notice that it is another one now.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Length, bytes.
    pub length: u64,
    /// Time of modification, nanoseconds since 1970.
    pub modified_ns: i64,
    /// BLAKE3 of the length (little-endian u64), the first and the last 64 KiB, in hex.
    pub blake3: String,
}

impl Fingerprint {
    /// Takes the fingerprint of the file at `path`, reading at most 128 KiB.
    ///
    /// # Errors
    /// Whatever opening or reading it says.
    pub fn of_file(path: &Path) -> io::Result<Self> {
        let (mut file, metadata) = open_regular(path)?;
        let length = metadata.len();
        let mut hasher = blake3::Hasher::new();
        hasher.update(&length.to_le_bytes());
        let mut sample = Vec::new();
        Read::by_ref(&mut file)
            .take(SAMPLE_BYTES)
            .read_to_end(&mut sample)?;
        if length > SAMPLE_BYTES {
            let tail = SAMPLE_BYTES.max(length - SAMPLE_BYTES);
            file.seek(SeekFrom::Start(tail))?;
            file.take(SAMPLE_BYTES).read_to_end(&mut sample)?;
        }
        hasher.update(&sample);
        Ok(Self {
            length,
            modified_ns: modified_ns(&metadata),
            blake3: hasher.finalize().to_hex().to_string(),
        })
    }

    /// Whether the contents are the same, whenever they were written: a copy is as good.
    pub(crate) fn has_contents_of(&self, other: &Self) -> bool {
        (self.length, &self.blake3) == (other.length, &other.blake3)
    }

    /// How `self`, taken earlier, differs from `now`; None if it does not.
    pub fn difference(&self, now: &Self) -> Option<String> {
        if self.length != now.length {
            Some(format!("length {} -> {} bytes", self.length, now.length))
        } else if self.blake3 != now.blake3 {
            Some("other contents".to_owned())
        } else if self.modified_ns != now.modified_ns {
            Some("written again since (time of modification)".to_owned())
        } else {
            None
        }
    }
}

/// Saturates in the year 2262; 0 where the file system keeps no times.
fn modified_ns(metadata: &std::fs::Metadata) -> i64 {
    let Ok(time) = metadata.modified() else {
        return 0;
    };
    match time.duration_since(UNIX_EPOCH) {
        Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
        Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |ns| -ns),
    }
}

/// BLAKE3 of a text, in hex.
pub fn text_hash(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// BLAKE3 of ordered settings, in hex. Lengths go in too, so that no two lists run together.
pub fn settings_hash(settings: &[(String, String)]) -> String {
    let mut hasher = blake3::Hasher::new();
    for text in settings.iter().flat_map(|(key, value)| [key, value]) {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// The settings that are not the same in both lists, by key; their order does not matter.
pub fn compare_settings(old: &[(String, String)], new: &[(String, String)]) -> Vec<SettingChange> {
    let value_in = |list: &[(String, String)], key: &str| {
        list.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone())
    };
    let gone = old.iter().filter(|(key, _)| value_in(new, key).is_none());
    new.iter()
        .chain(gone)
        .map(|(key, _)| SettingChange {
            key: key.clone(),
            old: value_in(old, key),
            new: value_in(new, key),
        })
        .filter(|change| change.old != change.new)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};
    use std::time::{Duration, SystemTime};

    fn pairs(list: &[(&str, &str)]) -> Vec<(String, String)> {
        list.iter()
            .map(|(k, v)| ((*k).to_owned(), (*v).to_owned()))
            .collect()
    }

    /// Writes `bytes` under a fixed time, so that only what the test changes differs.
    fn write(path: &Path, bytes: &[u8], seconds: u64) -> Fingerprint {
        fs::write(path, bytes).unwrap();
        let time = SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
        File::options()
            .write(true)
            .open(path)
            .unwrap()
            .set_modified(time)
            .unwrap();
        Fingerprint::of_file(path).unwrap()
    }

    #[test]
    fn notices_ends_length_and_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtk");
        for size in [1, 1000, 65_536, 65_537, 131_072, 131_073, 300_000] {
            let mut bytes = vec![7u8; size];
            let old = write(&path, &bytes, 5);
            assert_eq!(old.difference(&write(&path, &bytes, 5)), None);
            assert!(
                old.difference(&write(&path, &bytes, 6))
                    .unwrap()
                    .contains("time")
            );
            bytes[size - 1] = 8;
            assert_eq!(
                old.difference(&write(&path, &bytes, 5)).unwrap(),
                "other contents"
            );
            bytes[size - 1] = 7;
            bytes[0] = 8;
            assert_eq!(
                old.difference(&write(&path, &bytes, 5)).unwrap(),
                "other contents"
            );
            bytes.push(7);
            assert!(
                old.difference(&write(&path, &bytes, 5))
                    .unwrap()
                    .contains("length")
            );
        }
        write(&path, b"", 5);
        assert!(Fingerprint::of_file(&dir.path().join("none")).is_err());
    }

    #[test]
    fn changed_settings_are_named() {
        let old = pairs(&[
            ("render.max_depth", "3"),
            ("image.width", "640"),
            ("gone", "1"),
        ]);
        let new = pairs(&[
            ("image.width", "640"),
            ("render.max_depth", "5"),
            ("new", "2"),
        ]);
        let named: Vec<String> = compare_settings(&old, &new)
            .iter()
            .map(ToString::to_string)
            .collect();
        assert_eq!(
            named,
            [
                "render.max_depth: 3 -> 5",
                "new: (not set) -> 2",
                "gone: 1 -> (not set)"
            ]
        );
        assert!(compare_settings(&old, &old).is_empty());
    }

    #[test]
    fn hash_keeps_borders() {
        assert_ne!(
            settings_hash(&pairs(&[("ab", "c")])),
            settings_hash(&pairs(&[("a", "bc")]))
        );
    }
}
